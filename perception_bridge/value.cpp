#include "perception_bridge/value.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <unordered_set>

namespace sherlog {
namespace {

bool equal_objects(const Value::Object& a, const Value::Object& b) {
  if (a.size() != b.size()) return false;
  for (std::size_t i = 0; i < a.size(); ++i) {
    // Nearly always the order is the same.
    const Value* other = b[i].first == a[i].first ? &b[i].second : find(b, a[i].first);
    if (other == nullptr || !(*other == a[i].second)) return false;
  }
  return true;
}

// Builds the tree from the parser's events, without recursion.
class TreeBuilder : public nlohmann::json_sax<nlohmann::json> {
 public:
  Value result;
  std::string problem;

  bool null() override { return add(Value()); }
  bool boolean(bool flag) override { return add(Value(flag)); }
  bool number_integer(number_integer_t number) override { return add(Value(std::int64_t{number})); }
  bool number_unsigned(number_unsigned_t number) override {
    constexpr std::uint64_t kMost = std::numeric_limits<std::int64_t>::max();
    return add(number <= kMost ? Value(static_cast<std::int64_t>(number)) : Value(std::uint64_t{number}));
  }
  bool number_float(number_float_t number, const string_t&) override { return add(Value(double{number})); }
  bool string(string_t& text) override { return add(Value(std::move(text))); }
  bool binary(binary_t&) override { return false; }
  bool start_object(std::size_t) override { return open(Value(Value::Object{})); }
  bool end_object() override { return close(); }
  bool start_array(std::size_t) override { return open(Value(Value::List{})); }
  bool end_array() override { return close(); }
  bool key(string_t& name) override {
    Level& level = levels_.back();
    const bool is_new = level.value.object()->size() < 8 ? find(*level.value.object(), name) == nullptr
                                                         : (fill(level), level.keys.insert(name).second);
    if (!is_new) {
      problem = fmt::format("the key '{}' appears twice in one object", name);
      return false;
    }
    level.key = std::move(name);
    return true;
  }
  bool parse_error(std::size_t, const std::string&, const nlohmann::detail::exception& error) override {
    problem = error.what();
    // "[json.exception.parse_error.101] parse error at line 1, column 3: ..." without its first words
    if (const std::size_t at = problem.find(" at line "); at != std::string::npos) problem.erase(0, at + 4);
    if (const std::size_t at = problem.find("] "); problem.starts_with("[json.exception") && at != std::string::npos) {
      problem.erase(0, at + 2);
    }
    return false;
  }

 private:
  struct Level {
    Value value;
    std::string key;                       // of the value that comes next
    std::unordered_set<std::string> keys;  // of large objects
  };

  static void fill(Level& level) {
    if (!level.keys.empty()) return;
    for (const auto& [name, value] : *level.value.object()) level.keys.insert(name);
  }
  bool open(Value value) {
    if (levels_.size() == kDeepestJson) {
      problem = fmt::format("nested deeper than {} levels", kDeepestJson);
      return false;
    }
    levels_.push_back({std::move(value), {}, {}});
    return true;
  }
  bool close() {
    Value value = std::move(levels_.back().value);
    levels_.pop_back();
    return add(std::move(value));
  }
  bool add(Value value) {
    if (levels_.empty()) {
      result = std::move(value);
    } else if (Level& level = levels_.back(); Value::List* list = level.value.list()) {
      list->push_back(std::move(value));
    } else {
      level.value.object()->emplace_back(std::move(level.key), std::move(value));
    }
    return true;
  }

  std::vector<Level> levels_;
};

void write_text(const std::string& text, std::string& out) {
  out += '"';
  for (const char c : text) {
    switch (c) {
      case '"':
        out += "\\\"";
        break;
      case '\\':
        out += "\\\\";
        break;
      case '\n':
        out += "\\n";
        break;
      case '\t':
        out += "\\t";
        break;
      case '\r':
        out += "\\r";
        break;
      default:
        if (static_cast<unsigned char>(c) < 0x20) {
          out += fmt::format("\\u{:04x}", static_cast<unsigned>(c));
        } else {
          out += c;
        }
    }
  }
  out += '"';
}

void write_number(double number, std::string& out) {
  if (!std::isfinite(number)) {
    out += "null";
    return;
  }
  char digits[40];
  const auto end = std::to_chars(digits, digits + sizeof digits, number).ptr;
  const std::string_view text(digits, static_cast<std::size_t>(end - digits));
  out += text;
  if (text.find_first_of(".e") == std::string_view::npos) out += ".0";  // it stays a double when it is read again
}

class Writer {
 public:
  explicit Writer(int indent) : indent_(indent) {}

  void write(const Value& value, int level, std::string& out) const {
    if (const std::string* text = value.text()) return write_text(*text, out);
    if (const bool* flag = value.flag()) {
      out += *flag ? "true" : "false";
    } else if (const Value::List* list = value.list()) {
      write_list(*list, level, out);
    } else if (const Value::Object* object = value.object()) {
      write_object(*object, level, out);
    } else if (const auto whole = value.whole_number()) {
      out += std::to_string(*whole);
    } else if (const std::uint64_t* large = value.large_number()) {
      out += std::to_string(*large);
    } else if (const auto number = value.number()) {
      write_number(*number, out);
    } else {
      out += "null";
    }
  }

 private:
  void break_line(int level, std::string& out) const {
    if (indent_ < 0) return;
    out += '\n';
    out.append(static_cast<std::size_t>(indent_) * static_cast<std::size_t>(level), ' ');
  }
  // Lists of plain values stay on one line.
  void write_list(const Value::List& list, int level, std::string& out) const {
    bool nested = false;
    for (const Value& item : list) nested = nested || item.object() != nullptr || item.list() != nullptr;
    out += '[';
    for (std::size_t i = 0; i < list.size(); ++i) {
      if (i > 0) out += indent_ >= 0 && !nested ? ", " : ",";
      if (nested) break_line(level + 1, out);
      write(list[i], level + 1, out);
    }
    if (nested) break_line(level, out);
    out += ']';
  }
  void write_object(const Value::Object& object, int level, std::string& out) const {
    out += '{';
    for (std::size_t i = 0; i < object.size(); ++i) {
      if (i > 0) out += ',';
      break_line(level + 1, out);
      write_text(object[i].first, out);
      out += indent_ < 0 ? ":" : ": ";
      write(object[i].second, level + 1, out);
    }
    if (!object.empty()) break_line(level, out);
    out += '}';
  }

  int indent_;
};

// The next part of a pointer, which is cut off.
std::string next_part(std::string_view& pointer) {
  if (pointer.starts_with('/')) pointer.remove_prefix(1);
  const std::size_t end = std::min(pointer.find('/'), pointer.size());
  std::string part(pointer.substr(0, end));
  pointer.remove_prefix(end);
  for (std::size_t at = 0; (at = part.find('~', at)) != std::string::npos; ++at) {
    if (part.compare(at, 2, "~1") == 0) part.replace(at, 2, "/");
    if (part.compare(at, 2, "~0") == 0) part.replace(at, 2, "~");
  }
  return part;
}

void select_part(const Value& value, const std::string& part, std::vector<const Value*>& result) {
  if (const Value::List* list = value.list()) {
    std::size_t index = 0;
    const auto [end, error] = std::from_chars(part.data(), part.data() + part.size(), index);
    const bool is_index = error == std::errc() && end == part.data() + part.size();
    for (std::size_t i = 0; i < list->size(); ++i) {
      if (part == "*" || (is_index && i == index)) result.push_back(&(*list)[i]);
    }
  } else if (const Value::Object* object = value.object()) {
    for (const auto& [key, item] : *object) {
      if (part == "*" || part == key) result.push_back(&item);
    }
  }
}

}  // namespace

std::optional<double> Value::number() const {
  if (kind_ == Kind::kReal) return real_;
  if (kind_ == Kind::kWhole) return static_cast<double>(whole_);
  if (kind_ == Kind::kLarge) return static_cast<double>(large_);
  return std::nullopt;
}

std::optional<std::int64_t> Value::whole_number() const {
  return kind_ == Kind::kWhole ? std::optional(whole_) : std::nullopt;
}

std::string_view Value::kind() const {
  static constexpr std::string_view kKinds[] = {"null",     "a flag", "a whole number", "a whole number",
                                                "a number", "a text", "a list",         "an object"};
  return kKinds[static_cast<std::size_t>(kind_)];
}

const Value* Value::find(std::string_view key) const {
  const Object* mine = object();
  return mine == nullptr ? nullptr : sherlog::find(*mine, key);
}

bool operator==(const Value& a, const Value& b) {
  using Kind = Value::Kind;
  if (a.kind_ != b.kind_) {
    const auto first = a.number(), second = b.number();
    return first && second && *first == *second;
  }
  switch (a.kind_) {
    case Kind::kNull:
      return true;
    case Kind::kFlag:
      return a.flag_ == b.flag_;
    case Kind::kWhole:
      return a.whole_ == b.whole_;
    case Kind::kLarge:
      return a.large_ == b.large_;
    case Kind::kReal:
      return a.real_ == b.real_;
    case Kind::kText:
      return a.text_ == b.text_;
    case Kind::kList:
      return a.list_ == b.list_;
    case Kind::kObject:
      return equal_objects(a.object_, b.object_);
  }
  return false;
}

const Value* find(const Value::Object& object, std::string_view key) {
  for (const auto& [name, value] : object) {
    if (name == key) return &value;
  }
  return nullptr;
}

std::vector<const Value*> select(const Value& value, std::string_view pointer) {
  std::vector<const Value*> found = {&value};
  while (!pointer.empty() && !found.empty()) {
    const std::string part = next_part(pointer);
    std::vector<const Value*> next;
    for (const Value* item : found) select_part(*item, part, next);
    found = std::move(next);
  }
  return found;
}

std::vector<const Value*> select(const Value::Object& object, std::string_view pointer) {
  std::vector<const Value*> result;
  const std::string part = next_part(pointer);
  for (const auto& [key, value] : object) {
    if (part != "*" && part != key) continue;
    const auto below = select(value, pointer);
    result.insert(result.end(), below.begin(), below.end());
  }
  return result;
}

std::optional<std::vector<double>> numbers_of(const Value& value) {
  const Value::List* list = value.list();
  if (list == nullptr) return std::nullopt;
  std::vector<double> result;
  result.reserve(list->size());
  for (const Value& item : *list) {
    const auto number = item.number();
    if (!number) return std::nullopt;
    result.push_back(*number);
  }
  return result;
}

Value number_list(const std::vector<double>& numbers) {
  Value::List list;
  list.reserve(numbers.size());
  for (const double number : numbers) list.emplace_back(number);
  return Value(std::move(list));
}

std::optional<Value> parse_json(std::string_view text, std::string& problem) {
  TreeBuilder builder;
  if (nlohmann::json::sax_parse(text.begin(), text.end(), &builder)) return std::move(builder.result);
  problem = std::move(builder.problem);
  return std::nullopt;
}

std::string json_text(const Value& value, int indent) {
  std::string out;
  Writer(indent).write(value, 0, out);
  return out;
}

}  // namespace sherlog
