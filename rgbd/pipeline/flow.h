// Annotators, and the order in which they run: given, or planned from what is asked for.
//
// Idea      An annotator says what it reads and what it writes: views by name, annotations by type. A plan begins with
//           what is wanted and goes back through the writers to what the camera gives; who is not met on the way does
//           not run. Of two writers of a view the cheaper one runs; of annotations all do, since two opinions are
//           better than one; but not those that could not say what is asked for. The order is that of the list as far
//           as what they read allows, so it is the same every time.
// Source    Beetz et al., RoboSherlock, ICRA 2015, sections 3 and 6 (flow controllers; pipelines from queries)
// Errors    a sentence: a name that nobody writes and who wanted it; a cycle, with its members
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "rgbd/pipeline/analysis.h"

namespace sherlog::rgbd {

// To add one: a class with these five functions, and its line where the pipeline is made. See
// examples/add_an_annotator.cpp.
class Annotator {
 public:
  virtual ~Annotator() = default;
  virtual std::string name() const = 0;
  virtual std::vector<std::string> reads()
      const = 0;  // all of it is needed, but for annotations that nobody could write
  virtual std::vector<std::string> writes() const = 0;  // what it does not name here is refused
  // Which texts of such a type it may write, and which it can work with, upper and lower case alike. None: any.
  virtual std::vector<std::string> written_values(const std::string& /*type*/) const { return {}; }
  virtual std::vector<std::string> read_values(const std::string& /*type*/) const { return {}; }
  virtual double cost() const { return 1; }  // milliseconds, roughly
  // `in` has what reads() names. May throw: then nothing of `out` counts. Called once a frame, on any thread.
  virtual void process(const Analysis& in, Analysis& out) = 0;
};

// For annotators: an annotation in one expression.
Annotation make_annotation(std::string type, std::string source, Value::Object fields,
                           std::optional<double> confidence = {});

using Annotators = std::vector<std::unique_ptr<Annotator>>;

// Positions in the list, in an order in which they may run; of each the positions in the flow that it waits for.
struct Flow {
  std::vector<std::size_t> order;
  std::vector<std::vector<std::size_t>> after;
  std::vector<std::string> warnings = {};  // of values that nobody could write: all writers run, and none will
};

// A view or a type; of a type perhaps only one of these values, upper and lower case alike.
struct Wanted {
  std::string name;
  std::vector<std::string> values = {};
};

// `given`: views that are there from the start.
std::optional<Flow> plan_flow(const Annotators& annotators, std::span<const std::string> given,
                              std::span<const Wanted> wanted, std::string& problem);
// These, in this order. Refused where one reads what a later one writes, or nobody.
std::optional<Flow> fixed_flow(const Annotators& annotators, std::span<const std::string> given,
                               std::span<const std::string> names, std::string& problem);

}  // namespace sherlog::rgbd
