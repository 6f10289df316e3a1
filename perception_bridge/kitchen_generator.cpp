#include "perception_bridge/kitchen_generator.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string_view>

#include "mln/evidence.h"

namespace sherlog {
namespace {

// SplitMix64 (Steele, Lea & Flood, OOPSLA 2014): the same bits everywhere, unlike the distributions of <random>.
class SceneRandom {
 public:
  SceneRandom(std::uint64_t seed, std::uint64_t number) : state_(mix(seed) ^ mix(~number)) {}

  // Uniform in [0, 1), 53 bits.
  double uniform() { return static_cast<double>(next() >> 11) * 0x1.0p-53; }
  bool with_probability(double p) { return uniform() < p; }
  std::uint32_t below(std::size_t n) { return static_cast<std::uint32_t>(uniform() * static_cast<double>(n)); }
  // An index, as often as its weight says; the sum of the weights is positive.
  std::uint32_t choose(const std::vector<double>& weights) {
    double left = uniform() * std::accumulate(weights.begin(), weights.end(), 0.0);
    std::uint32_t last = 0;
    for (std::uint32_t i = 0; i < weights.size(); ++i) {
      if (weights[i] <= 0.0) continue;
      if (left < weights[i]) return i;
      left -= weights[i];
      last = i;
    }
    return last;
  }

 private:
  static std::uint64_t mix(std::uint64_t z) {
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
    return z ^ (z >> 31);
  }
  std::uint64_t next() { return mix(state_ += 0x9e3779b97f4a7c15ULL); }

  std::uint64_t state_;
};

std::vector<std::uint32_t> draw_classes(const KitchenConfig& config, std::uint32_t context, std::size_t count,
                                        SceneRandom& random) {
  std::vector<double> weights;
  for (const KitchenClass& c : config.classes) weights.push_back(c.frequency[context]);
  std::vector<std::uint32_t> drawn;
  const auto total = [&] { return std::accumulate(weights.begin(), weights.end(), 0.0); };
  while (drawn.size() < count && total() > 0.0) {
    drawn.push_back(random.choose(weights));
    const std::string& name = config.classes[drawn.back()].name;
    weights[drawn.back()] *= config.same_class;
    for (const KitchenPair& pair : config.pairs) {
      if (pair.first != name && pair.second != name) continue;
      const std::string& other = pair.first == name ? pair.second : pair.first;
      for (std::size_t c = 0; c < weights.size(); ++c) {
        if (config.classes[c].name == other) weights[c] *= pair.factor;
      }
    }
  }
  return drawn;
}

// One value, confused with any other by `confusion`.
std::uint32_t look(const std::vector<double>& weights, double confusion, SceneRandom& random) {
  const std::uint32_t value = random.choose(weights);
  if (weights.size() < 2 || !random.with_probability(confusion)) return value;
  const std::uint32_t other = random.below(weights.size() - 1);
  return other + (other >= value ? 1u : 0u);
}

// Adds a value that is not there yet, where some such value has a weight.
bool look_again(std::vector<double> weights, std::vector<std::uint32_t>& values, SceneRandom& random) {
  for (const std::uint32_t value : values) weights[value] = 0.0;
  if (std::accumulate(weights.begin(), weights.end(), 0.0) <= 0.0) return false;
  values.push_back(random.choose(weights));
  return true;
}

// What an annotator says of a thing of class `truth`: `answer(class)` is what it would say of a class, empty where nothing.
template <class Answer>
std::optional<std::string> annotate(const KitchenConfig& config, const KitchenAnnotator& annotator, std::uint32_t truth,
                                    const Answer& answer, SceneRandom& random) {
  // Always the same number of draws: a change of one rate leaves the rest of the scene as it is.
  const bool answers = random.with_probability(annotator.rate);
  const bool right = random.with_probability(annotator.right);
  std::vector<double> others;
  for (std::uint32_t c = 0; c < config.classes.size(); ++c) {
    others.push_back(c != truth && !answer(c).empty() ? 1.0 : 0.0);
  }
  const double possible = std::accumulate(others.begin(), others.end(), 0.0);
  const std::uint32_t other = possible > 0.0 ? random.choose(others) : truth;
  if (!answers || answer(truth).empty()) return std::nullopt;
  return answer(right ? truth : other);
}

void annotate_print(const KitchenConfig& config, KitchenObject& object, SceneRandom& random) {
  const auto& classes = config.classes;
  const double which = random.uniform();  // of several words on a thing
  const auto word = [&](std::uint32_t c) {
    const auto& words = classes[c].words;
    if (words.empty()) return std::string();
    return words[std::min(words.size() - 1, static_cast<std::size_t>(which * static_cast<double>(words.size())))];
  };
  const std::uint32_t truth = object.object_class;
  object.text = annotate(config, config.text, truth, word, random);
  object.logo = annotate(
      config, config.logo, truth, [&](std::uint32_t c) { return classes[c].company; }, random);
  object.image = annotate(
      config, config.image, truth, [&](std::uint32_t c) { return classes[c].product; }, random);
  object.product = annotate(
      config, config.product, truth, [&](std::uint32_t c) { return classes[c].product; }, random);
  object.contact = annotate(
      config, config.contact, truth, [&](std::uint32_t c) { return classes[c].contact; }, random);
  object.detected = annotate(
      config, config.detector, truth,
      [&](std::uint32_t c) { return classes[c].detectable ? classes[c].name : std::string(); }, random);
}

// --- text -------------------------------------------------------------------------------------------------------------

class SceneWriter {
 public:
  explicit SceneWriter(const KitchenTextOptions& options) : recorded_(options.spelling == KitchenSpelling::kRecorded) {}

  // A value of a small fixed domain.
  std::string value(std::string_view name) const {
    std::string out(name);
    if (recorded_) {
      std::transform(out.begin(), out.end(), out.begin(),
                     [](unsigned char c) { return static_cast<char>(c >= 'A' && c <= 'Z' ? c - 'A' + 'a' : c); });
    }
    return constant(out);
  }
  std::string constant(std::string_view name) const {
    std::string out(name);
    if (recorded_) std::replace(out.begin(), out.end(), ' ', '_');
    return quoted_constant(out);
  }
  void atom(std::string_view predicate, std::size_t cluster, const std::string& value) {
    text_ += fmt::format("{}(c{},{})\n", predicate, cluster + 1, value);
  }
  void atom(std::string_view predicate, std::size_t cluster, const std::optional<std::string>& value) {
    if (value) atom(predicate, cluster, constant(*value));
  }
  std::string& text() { return text_; }

 private:
  bool recorded_;
  std::string text_;
};

// --- checks -----------------------------------------------------------------------------------------------------------

bool is_probability(double p) { return p >= 0.0 && p <= 1.0; }

std::string weights_problem(const std::vector<double>& weights, std::size_t expected, const std::string& name) {
  if (weights.size() != expected) return fmt::format("{}: {} numbers, {} expected", name, weights.size(), expected);
  double sum = 0.0;
  for (const double weight : weights) {
    if (!std::isfinite(weight) || weight < 0.0)
      return fmt::format("{}: {} is not a weight of at least 0", name, weight);
    sum += weight;
  }
  return sum > 0.0 ? std::string() : name + ": no weight is positive";
}

std::string class_problem(const KitchenConfig& config, const KitchenClass& c) {
  if (c.name.empty()) return "a class needs a name";
  if (c.frequency.size() != config.contexts.size()) return c.name + ": one frequency for each context is needed";
  for (const double frequency : c.frequency) {
    if (!std::isfinite(frequency) || frequency < 0.0) return c.name + ": a frequency is at least 0";
  }
  if (std::string problem = weights_problem(c.shapes, config.shapes.size(), c.name + ": shapes"); !problem.empty()) {
    return problem;
  }
  if (std::string problem = weights_problem(c.colors, config.colors.size(), c.name + ": colors"); !problem.empty()) {
    return problem;
  }
  return is_probability(c.big) ? std::string() : c.name + ": big is a probability";
}

}  // namespace

std::string validate(const KitchenConfig& config) {
  for (const auto& [weights, count, name] :
       {std::tuple{&config.context_frequency, config.contexts.size(), "context_frequency"},
        std::tuple{&config.object_counts, config.object_counts.size(), "object_counts"}}) {
    if (std::string problem = weights_problem(*weights, count, name); !problem.empty()) return problem;
  }
  for (const KitchenClass& c : config.classes) {
    if (std::string problem = class_problem(config, c); !problem.empty()) return problem;
  }
  for (std::size_t context = 0; context < config.contexts.size(); ++context) {
    const bool some = std::any_of(config.classes.begin(), config.classes.end(),
                                  [&](const KitchenClass& c) { return c.frequency[context] > 0.0; });
    if (!some) return fmt::format("context '{}' has no classes", config.contexts[context]);
  }
  const auto known = [&](const std::string& name) {
    return std::any_of(config.classes.begin(), config.classes.end(),
                       [&](const KitchenClass& c) { return c.name == name; });
  };
  for (const KitchenPair& pair : config.pairs) {
    for (const std::string& name : {pair.first, pair.second}) {
      if (!known(name)) return fmt::format("pairs: there is no class '{}'", name);
    }
    if (!std::isfinite(pair.factor) || pair.factor < 0.0) return "pairs: a factor is at least 0";
  }
  if (!std::isfinite(config.same_class) || config.same_class < 0.0) return "same_class: a factor is at least 0";
  for (const double p : {config.shape_confusion, config.color_confusion, config.size_confusion, config.second_shape,
                         config.another_color, config.size_missing}) {
    if (!is_probability(p)) return fmt::format("{} is not a probability", p);
  }
  for (const KitchenAnnotator* annotator :
       {&config.text, &config.logo, &config.image, &config.product, &config.contact, &config.detector}) {
    if (!is_probability(annotator->rate) || !is_probability(annotator->right)) {
      return fmt::format("an annotator with rate {} and right {}: both are probabilities", annotator->rate,
                         annotator->right);
    }
  }
  return "";
}

KitchenScene generate_kitchen_scene(const KitchenConfig& config, std::uint64_t seed, std::uint64_t number) {
  SceneRandom random(seed, number);
  KitchenScene scene;
  scene.context = random.choose(config.context_frequency);
  const std::size_t count = random.choose(config.object_counts);
  for (const std::uint32_t drawn : draw_classes(config, scene.context, count, random)) {
    const KitchenClass& c = config.classes[drawn];
    KitchenObject object;
    object.object_class = drawn;
    object.shapes.push_back(look(c.shapes, config.shape_confusion, random));
    if (random.with_probability(config.second_shape)) {
      // A second shape comes from the way of looking more than from the thing: any other will do.
      look_again(std::vector<double>(config.shapes.size(), 1.0), object.shapes, random);
    }
    object.colors.push_back(look(c.colors, config.color_confusion, random));
    while (random.with_probability(config.another_color) && look_again(c.colors, object.colors, random)) {
    }
    const bool is_big = random.with_probability(c.big) != random.with_probability(config.size_confusion);
    if (!random.with_probability(config.size_missing)) object.big = is_big;
    annotate_print(config, object, random);
    scene.objects.push_back(std::move(object));
  }
  return scene;
}

std::string kitchen_scene_text(const KitchenConfig& config, const KitchenScene& scene,
                               const KitchenTextOptions& options) {
  SceneWriter writer(options);
  writer.text() += fmt::format("scene({})\n", writer.value(config.contexts[scene.context]));
  for (std::size_t cluster = 0; cluster < scene.objects.size(); ++cluster) {
    const KitchenObject& object = scene.objects[cluster];
    for (const std::uint32_t shape : object.shapes) writer.atom("shape", cluster, writer.value(config.shapes[shape]));
    for (const std::uint32_t color : object.colors) writer.atom("color", cluster, writer.value(config.colors[color]));
    if (options.all_annotators && object.big) writer.atom("size", cluster, writer.value(*object.big ? "Big" : "Small"));
    writer.atom("goggles_Text", cluster, object.text);
    writer.atom("goggles_Logo", cluster, object.logo);
    writer.atom("goggles", cluster, object.image);
    writer.atom("goggles_Contact", cluster, object.contact);
    if (options.all_annotators) {
      writer.atom("goggles_Product", cluster, object.product);
      writer.atom("linemod", cluster, object.detected);
    }
    if (options.labels) writer.atom("object", cluster, writer.constant(config.classes[object.object_class].name));
  }
  return std::move(writer.text());
}

std::string kitchen_text(const KitchenConfig& config, std::uint64_t seed, std::uint64_t count,
                         const KitchenTextOptions& options) {
  std::string text;
  for (std::uint64_t number = 0; number < count; ++number) {
    if (number > 0) text += "---\n";
    text += kitchen_scene_text(config, generate_kitchen_scene(config, seed, number), options);
  }
  return text;
}

}  // namespace sherlog
