// JSON documents as values: what annotations carry, known keys and unknown ones alike.
//
// Idea      A scene must come out as it went in, with keys that we have never heard of and in the order of its author. So a
//           document is kept as a small tree of our own: objects are lists of pairs in the order of the text, whole numbers stay
//           whole numbers. Users of the library need no JSON library for it.
// Errors    parse_json returns nothing and a sentence with line and column; it refuses keys that appear twice in one object,
//           invalid UTF-8, numbers beyond a double, and nesting deeper than kDeepestJson.
// Cost      linear in the text
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace sherlog {

inline constexpr std::size_t kDeepestJson = 64;

class Value {
 public:
  using List = std::vector<Value>;
  using Object = std::vector<std::pair<std::string, Value>>;  // keys are distinct

  Value() = default;  // null
  explicit Value(bool flag) : kind_(Kind::kFlag), flag_(flag) {}
  explicit Value(std::int64_t number) : kind_(Kind::kWhole), whole_(number) {}
  explicit Value(std::uint64_t number) : kind_(Kind::kLarge), large_(number) {}
  explicit Value(double number) : kind_(Kind::kReal), real_(number) {}
  explicit Value(std::string text) : kind_(Kind::kText), text_(std::move(text)) {}
  explicit Value(const char* text) : kind_(Kind::kText), text_(text) {}
  explicit Value(List list) : kind_(Kind::kList), list_(std::move(list)) {}
  explicit Value(Object object) : kind_(Kind::kObject), object_(std::move(object)) {}

  bool is_null() const { return kind_ == Kind::kNull; }
  const bool* flag() const { return kind_ == Kind::kFlag ? &flag_ : nullptr; }
  const std::string* text() const { return kind_ == Kind::kText ? &text_ : nullptr; }
  const List* list() const { return kind_ == Kind::kList ? &list_ : nullptr; }
  List* list() { return kind_ == Kind::kList ? &list_ : nullptr; }
  const Object* object() const { return kind_ == Kind::kObject ? &object_ : nullptr; }
  Object* object() { return kind_ == Kind::kObject ? &object_ : nullptr; }
  std::optional<double> number() const;
  std::optional<std::int64_t> whole_number() const;
  // Above the range of the former.
  const std::uint64_t* large_number() const { return kind_ == Kind::kLarge ? &large_ : nullptr; }
  // "a text", "a list", ... for messages.
  std::string_view kind() const;

  // The value under this key; null pointer where this is no object or has no such key.
  const Value* find(std::string_view key) const;

  // Objects are equal whatever the order of their keys; 1 and 1.0 are equal.
  friend bool operator==(const Value& a, const Value& b);

 private:
  enum class Kind : std::uint8_t { kNull, kFlag, kWhole, kLarge, kReal, kText, kList, kObject };

  // Plain members instead of a variant: GCC 12 warns of uninitialised memory wherever a recursive variant is inlined.
  Kind kind_ = Kind::kNull;
  std::int64_t whole_ = 0;
  std::uint64_t large_ = 0;
  double real_ = 0;
  bool flag_ = false;
  std::string text_;
  List list_;
  Object object_;
};

const Value* find(const Value::Object& object, std::string_view key);

// The values at a pointer such as "/confidences/*/score": '*' stands for every element, a number for one; "" is the
// value itself.
std::vector<const Value*> select(const Value& value, std::string_view pointer);
std::vector<const Value*> select(const Value::Object& object, std::string_view pointer);

// The numbers of a list of numbers, or nothing where it is something else.
std::optional<std::vector<double>> numbers_of(const Value& value);
Value number_list(const std::vector<double>& numbers);

std::optional<Value> parse_json(std::string_view text, std::string& problem);
// On one line without blanks; what JSON cannot say (NaN, infinities) becomes null. With an indent: one key a line.
std::string json_text(const Value& value, int indent = -1);

}  // namespace sherlog
