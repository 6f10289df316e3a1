#include "perception_bridge/four_tables_json.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

namespace sherlog {
namespace {

using Json = nlohmann::ordered_json;

std::string old_id(std::size_t o) { return fmt::format("O{}", o + 1); }
std::string new_id(std::size_t n) { return fmt::format("N{}", n + 1); }

Json observation_json(const Observation& observation, std::string id) {
  Json json;
  json["id"] = std::move(id);
  json["object"] = observation.object;
  json["table"] = observation.table;
  json["position"] = observation.position;
  json["color"] = observation.color;
  return json;
}

Json resolution_json(const Resolution& resolution) {
  Json json;
  json["association"] = Json::object();
  json["explanation"] = Json::object();
  for (std::size_t n = 0; n < resolution.association.size(); ++n) {
    Json& partner = json["association"][new_id(n)];
    if (resolution.association[n]) partner = old_id(*resolution.association[n]);
  }
  for (std::size_t o = 0; o < resolution.explanation.size(); ++o) {
    json["explanation"][old_id(o)] = to_string(resolution.explanation[o]);
  }
  for (std::size_t n = 0; n < resolution.association.size(); ++n) {
    if (!resolution.association[n]) json["explanation"][new_id(n)] = to_string(ClusterExplanation::kAppear);
  }
  return json;
}

}  // namespace

std::string trial_line(const FourTablesTrial& trial, const MatcherAnswer& answer, bool with_seconds) {
  Json json;
  json["trial"] = trial.number;
  json["seed"] = trial.seed;
  json["objects"] = trial.config.objects;
  json["noise"] = trial.config.noise;
  json["view"] = {{"table", trial.view.table}, {"min", trial.view.min}, {"max", trial.view.max}};
  json["actions"] = Json::array();
  for (const SimulatedAction& action : trial.actions) {
    json["actions"].push_back({{"kind", to_string(action.kind)}, {"object", action.object}});
  }
  json["old"] = Json::array();
  for (std::size_t o = 0; o < trial.old_clusters.size(); ++o) {
    Json old = observation_json(trial.old_clusters[o], old_id(o));
    old["out_of_view"] = trial.old_clusters[o].out_of_view;
    json["old"].push_back(std::move(old));
  }
  json["new"] = Json::array();
  for (std::size_t n = 0; n < trial.new_clusters.size(); ++n) {
    json["new"].push_back(observation_json(trial.new_clusters[n], new_id(n)));
  }
  json["truth"] = resolution_json(trial.truth);
  json["result"] = resolution_json(answer.resolution);
  if (with_seconds) json["result"]["seconds"] = answer.seconds;
  return json.dump() + "\n";
}

}  // namespace sherlog
