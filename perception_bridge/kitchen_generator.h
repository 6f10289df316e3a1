// Synthetic kitchen scenes: labelled objects and what a robot's annotators would report of them, as evidence.
//
// Idea      A stand-in for recorded scenes, with their difficulties and with every number in one place. A scene has a context
//           (breakfast, cooking, ...) and some objects. Their classes are drawn one after the other: as frequent as the
//           context makes them, times a factor for each object that is there already (cereals call for milk, a
//           second toaster is rare). Then the annotators look at each object. Shape, colour and size are always
//           reported and are sometimes confused; a thing can have two shapes and several colours at once. Reading
//           words and signs works on printed things only, and rarely; the detector knows some classes, is silent about
//           most things and right about half of the time.
// Input     a KitchenConfig; default_kitchen() has the classes and contexts of models/information_fusion
// Output    scenes as values, or as the text of a .db file with --- between scenes
// Random    draws only from (seed, number of the scene): scene 7 is the same whether 10 or 10,000 are made, on every machine
// Cost      linear in the number of objects; a million objects in a few seconds
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace sherlog {

struct KitchenClass {
  std::string name;
  std::vector<double> frequency;  // by context: relative
  std::vector<double> shapes;     // by shape: relative
  std::vector<double> colors;     // by colour: relative
  double big = 1.0;               // probability of being a big one
  // What can be read on it or found with its picture; empty where nothing can.
  std::vector<std::string> words;
  std::string company;
  std::string product;
  std::string contact;
  bool detectable = false;  // the detector was trained on it
};

// The presence of one multiplies the frequency of the other.
struct KitchenPair {
  std::string first, second;
  double factor = 1.0;
};

// An annotator that does not answer every time.
struct KitchenAnnotator {
  double rate = 0.0;   // of the things about which it could say something
  double right = 1.0;  // of its answers; a wrong one is what it would say about some other class
};

struct KitchenConfig {
  std::vector<std::string> contexts, shapes, colors;
  std::vector<double> context_frequency;  // relative
  std::vector<double> object_counts;      // relative frequency of scenes with 0, 1, 2, ... objects
  std::vector<KitchenClass> classes;
  std::vector<KitchenPair> pairs;
  double same_class = 1.0;       // factor for each object of the class that is there already
  double shape_confusion = 0.0;  // probability that a reported shape is any other one
  double color_confusion = 0.0;
  double size_confusion = 0.0;
  double second_shape = 0.0;   // probability that another shape is reported as well
  double another_color = 0.0;  // that one more colour is reported, and again until it is not
  double size_missing = 0.0;
  KitchenAnnotator text, logo, image, product, contact, detector;
};

// Four contexts and the 25 classes of models/information_fusion/predicates.mln. The frequencies are guesses of ours; the rates
// are set so that the counts are near those of the paper's recordings (multi-valued shapes and colours, 2 to 8
// objects, its Fig. 6).
KitchenConfig default_kitchen();

// What is wrong with it, or nothing: lengths that differ, a factor below 0, a probability above 1, an unknown class.
std::string validate(const KitchenConfig& config);

struct KitchenObject {
  std::uint32_t object_class = 0;
  std::vector<std::uint32_t> shapes, colors;  // distinct
  std::optional<bool> big;                    // as reported
  std::optional<std::string> text, logo, image, product, contact, detected;
};

struct KitchenScene {
  std::uint32_t context = 0;
  std::vector<KitchenObject> objects;
};

// Requires  validate() finds nothing.
KitchenScene generate_kitchen_scene(const KitchenConfig& config, std::uint64_t seed, std::uint64_t number);

enum class KitchenSpelling : std::uint8_t {
  kModel,  // shape(c1,Box), goggles_Logo(c1,"Dr Oetker"): as models/information_fusion/kitchen_predicates.mln declares them
  kRecorded,  // shape(c1,box), goggles_Logo(c1,Dr_Oetker): values in lower case, no blanks, as in published recordings
};

struct KitchenTextOptions {
  KitchenSpelling spelling = KitchenSpelling::kModel;
  bool all_annotators = true;  // false: only those of predicates.mln, without size, linemod and goggles_Product
  bool labels = true;          // false: without object(...), as a robot sees it
};

// One database, without a separator.
std::string kitchen_scene_text(const KitchenConfig& config, const KitchenScene& scene,
                               const KitchenTextOptions& options = {});
// Scenes 0 to count - 1 with --- between them.
std::string kitchen_text(const KitchenConfig& config, std::uint64_t seed, std::uint64_t count,
                         const KitchenTextOptions& options = {});

}  // namespace sherlog
