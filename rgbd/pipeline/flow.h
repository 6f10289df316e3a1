// Annotators, and the order in which they run: given, or planned from what is asked for.
//
// Idea      An annotator says what it reads and what it writes: views by name, annotations by type. Who has all that it needs from
//           the camera or from others can run; a plan begins with what is wanted and goes back through those who can and
//           write it. Of a view (and of RoboSherlock's types of images and clouds, rs.cv and rs.pcl) the cheapest one
//           runs, of annotations all, since two opinions are better than one; but not those that could not say what is
//           asked for. The order is that of the list as far as what they read allows. Where that goes in a circle, as
//           when several change what one wrote, the first of the list that can go on without the others does, and does
//           not see what they say. So the flow is the same every time.
// Source    Beetz et al., RoboSherlock, ICRA 2015, sections 3 and 6 (flow controllers; pipelines from queries)
// Errors    a sentence: a name that nobody writes and who wanted it; a circle that nobody can begin, with its members
// Cost      O(n^2) for n annotators, and as much again for each that begins a circle
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "rgbd/pipeline/analysis.h"

namespace sherlog::rgbd {

// To add one: a class with the functions that have no body here, and its line where the pipeline is made. See
// examples/add_an_annotator.cpp.
class Annotator {
 public:
  virtual ~Annotator() = default;
  virtual std::string name() const = 0;
  virtual std::vector<std::string> reads() const = 0;   // all of it is needed
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

// Positions in the list, in an order in which they may run.
struct Flow {
  // What a step is given of one before it.
  struct Input {
    std::size_t from = 0;
    std::vector<std::string> names;
  };
  std::vector<std::size_t> order;
  std::vector<std::vector<Input>> inputs;
  // Of values that nobody could write: all writers run, and none will. Of writers that are left out, as they cannot run, or
  // come too late.
  std::vector<std::string> warnings = {};
};

// A view or a type, or one of several; of types perhaps only one of these values, upper and lower case alike.
struct Wanted {
  std::vector<std::string> names;
  std::vector<std::string> values = {};
  bool is_needed = true;  // false: there is a plan without it too, and a warning
};

// Whether it writes the view, or annotations of the type.
bool provides(const Annotator& annotator, const std::string& name);

// `given`: views that are there from the start.
std::optional<Flow> plan_flow(const Annotators& annotators, std::span<const std::string> given,
                              std::span<const Wanted> wanted, std::string& problem);
// These, in this order. A view comes from the last one before that writes it, annotations from all before. Refused where nobody
// before writes what one reads. `wanted` is looked at for warnings alone.
std::optional<Flow> fixed_flow(const Annotators& annotators, std::span<const std::string> given,
                               std::span<const std::string> names, std::span<const Wanted> wanted,
                               std::string& problem);

}  // namespace sherlog::rgbd
