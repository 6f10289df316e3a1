// A scene store in a folder of its own, and small scenes to put into it.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sqlite3.h>
#include <unistd.h>

#include <filesystem>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "perception_bridge/scene_lines.h"
#include "perception_bridge/scene_store.h"

namespace sherlog {

class SceneStoreFile : public testing::Test {
 protected:
  SceneStoreFile() {
    std::string name = (std::filesystem::temp_directory_path() / "sherlog-store-XXXXXX").string();
    folder_ = mkdtemp(name.data());
    path_ = (folder_ / "robot.db").string();
  }
  ~SceneStoreFile() override { std::filesystem::remove_all(folder_); }

  SceneStore open(const SqlOpen& how = {}) {
    std::string problem;
    auto store = SceneStore::open(path_, how, problem);
    EXPECT_TRUE(store) << problem;
    return std::move(*store);
  }
  std::string problem_of(const SqlOpen& how) {
    std::string problem;
    EXPECT_FALSE(SceneStore::open(path_, how, problem));
    return problem;
  }
  void run_sql(const std::string& sql) {
    sqlite3* handle = nullptr;
    ASSERT_EQ(sqlite3_open(path_.c_str(), &handle), SQLITE_OK);
    ASSERT_EQ(sqlite3_exec(handle, sql.c_str(), nullptr, nullptr, nullptr), SQLITE_OK) << sqlite3_errmsg(handle);
    sqlite3_close(handle);
  }
  static ImportResult import(SceneStore& store, const std::string& text, const ImportOptions& options = {}) {
    std::istringstream in(text);
    Monitor monitor;
    return import_lines(store, in, options, monitor);
  }
  static std::string exported(SceneStore& store) {
    std::string text;
    EXPECT_TRUE(export_lines(store, {}, [&](std::string_view line) { return text += line, true; }));
    return text;
  }

  std::filesystem::path folder_;
  std::string path_;
};

inline Annotation label(const std::string& name, double confidence = 0.9) {
  Annotation annotation;
  annotation.type = "rs.annotation.Detection";
  annotation.confidence = confidence;
  annotation.fields = {{"name", Value(name)}};
  return annotation;
}

inline Annotation on(const std::string& place) {
  Annotation annotation;
  annotation.type = "rs.annotation.TFLocation";
  annotation.fields = {{"frame_id", Value(place)}};
  return annotation;
}

inline Scene small_scene(const std::string& id, double time,
                         const std::vector<std::pair<std::string, std::string>>& things) {
  Scene scene;
  scene.id = id;
  scene.timestamp = time;
  for (const auto& [name, place] : things) {
    Cluster& cluster = scene.clusters.emplace_back();
    cluster.id = "c" + std::to_string(scene.clusters.size() - 1);
    cluster.annotations = {label(name), on(place)};
  }
  return scene;
}

inline std::string line(const std::string& id, double time = 1) {
  return R"({"id":")" + id + R"(","timestamp":)" + std::to_string(time) + "}\n";
}

}  // namespace sherlog
