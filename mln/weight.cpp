// Recursive descent over arithmetic, evaluating on the way (weight.h).
#include "mln/weight.h"

#include <charconv>
#include <cmath>
#include <limits>
#include <system_error>

namespace sherlog {

namespace {

// The value of a number token. Too small for a double is 0, too large is infinite.
double number_value(std::string_view text) {
  double value = 0;
  const auto result = std::from_chars(text.data(), text.data() + text.size(), value);
  if (result.ec != std::errc::result_out_of_range) return value;
  const bool tiny = text.find("e-") != text.npos || text.find("E-") != text.npos || text[0] == '0' || text[0] == '.';
  return tiny ? 0.0 : std::numeric_limits<double>::infinity();
}

bool is_not_finite(std::string_view name) {
  return name == "inf" || name == "Inf" || name == "infinity" || name == "nan" || name == "NaN";
}

class WeightReader {
 public:
  WeightReader(Lexer lexer, const Token& first, int max_depth) : lexer_(lexer), max_depth_(max_depth) {
    begin_ = first.begin;
    lexer_.rewind(first);
    token_ = lexer_.next(Lexer::Mode::kArithmetic);
    last_ = token_;
  }

  std::optional<Weight> read() {
    Weight weight;
    const std::optional<double> value = sum();
    weight.too_deep = too_deep_;
    if (!value && !too_deep_) return std::nullopt;
    weight.value = value.value_or(0);
    weight.negates = zero_logx_ && logx_begin_ == begin_ && logx_end_ == last_.end;
    weight.last = last_;
    weight.text = text();
    return weight;
  }

 private:
  struct State {
    Lexer lexer;
    Token token;
    Token last;
  };
  State save() const { return {lexer_, token_, last_}; }
  void restore(const State& state) {
    lexer_ = state.lexer;
    token_ = state.token;
    last_ = state.last;
  }
  void take() {
    last_ = token_;
    token_ = lexer_.next(Lexer::Mode::kArithmetic);
  }
  // A line break ends a weight outside brackets.
  bool at(TokenKind kind) const {
    if (token_.line_break && open_ == 0 && token_.begin != begin_) return false;
    return token_.kind == kind;
  }
  bool enter() {
    too_deep_ = too_deep_ || depth_ >= max_depth_;
    return !too_deep_;
  }

  std::optional<double> sum() {
    std::optional<double> left = product();
    while (left && (at(TokenKind::kPlus) || at(TokenKind::kMinus))) {
      const State before = save();
      const bool plus = token_.kind == TokenKind::kPlus;
      take();
      const std::optional<double> right = product();
      if (!right) {
        restore(before);
        break;
      }
      left = plus ? *left + *right : *left - *right;
    }
    return left;
  }

  std::optional<double> product() {
    std::optional<double> left = signed_power();
    while (left && (at(TokenKind::kStar) || at(TokenKind::kSlash))) {
      const State before = save();
      const bool times = token_.kind == TokenKind::kStar;
      take();
      const std::optional<double> right = signed_power();
      if (!right) {
        restore(before);
        break;
      }
      left = times ? *left * *right : *left / *right;
    }
    return left;
  }

  std::optional<double> signed_power() {
    double sign = 1;
    while (at(TokenKind::kMinus) || at(TokenKind::kPlus)) {
      if (token_.kind == TokenKind::kMinus) sign = -sign;
      take();
    }
    const std::optional<double> base = primary();
    if (!base) return std::nullopt;
    if (at(TokenKind::kAnd) && token_.text == "^") {
      const State before = save();
      take();
      if (!enter()) return std::nullopt;
      ++depth_;
      const std::optional<double> exponent = signed_power();  // right-associative
      --depth_;
      if (exponent) return sign * std::pow(*base, *exponent);
      restore(before);
    }
    return sign * *base;
  }

  std::optional<double> primary() {
    if (at(TokenKind::kNumber)) {
      const double value = number_value(token_.text);
      take();
      return value;
    }
    if (at(TokenKind::kOpen)) return bracketed();
    if (at(TokenKind::kName)) return named();
    return std::nullopt;
  }

  std::optional<double> bracketed() {
    if (!enter()) return std::nullopt;
    ++depth_;
    ++open_;
    take();
    std::optional<double> value = sum();
    --depth_;
    if (value && at(TokenKind::kClose)) {
      --open_;
      take();
      return value;
    }
    --open_;
    return std::nullopt;
  }

  std::optional<double> named() {
    const State before = save();
    const Token name = token_;
    take();
    if (name.text == "float" && at(TokenKind::kOpen)) return infinite_literal(before);
    if (is_not_finite(name.text) && (at(TokenKind::kName) || at(TokenKind::kNot) || at(TokenKind::kColon))) {
      return std::numeric_limits<double>::infinity();
    }
    if (!at(TokenKind::kOpen)) return std::nullopt;
    const std::optional<double> argument = bracketed();
    if (!argument) return std::nullopt;
    if (name.text == "log" || name.text == "ln") return std::log(*argument);
    if (name.text == "exp") return std::exp(*argument);
    if (name.text == "sqrt") return std::sqrt(*argument);
    if (name.text != "logx") return std::nullopt;
    zero_logx_ = *argument == 0;
    logx_begin_ = name.begin;
    logx_end_ = last_.end;
    return std::log(*argument);
  }

  // float('inf'), as pracmln's models write it.
  std::optional<double> infinite_literal(const State& before) {
    const std::string_view rest = lexer_.text().substr(token_.begin);
    if (!rest.starts_with("('") && !rest.starts_with("(\"")) {
      restore(before);
      return std::nullopt;
    }
    while (token_.kind != TokenKind::kClose && token_.kind != TokenKind::kEnd) take();
    take();
    return std::numeric_limits<double>::infinity();
  }

  // As written, but on one line and without comments.
  std::string text() const {
    const std::string_view written = lexer_.text().substr(begin_, last_.end - begin_);
    if (written.find('\n') == written.npos && written.find("/*") == written.npos) return std::string(written);
    std::string result;
    Lexer lexer(written);
    for (Token token = lexer.next(Lexer::Mode::kArithmetic); token.kind != TokenKind::kEnd;
         token = lexer.next(Lexer::Mode::kArithmetic)) {
      result += token.text;
    }
    return result;
  }

  Lexer lexer_;
  int max_depth_;
  std::size_t begin_ = 0;
  Token token_;
  Token last_;
  int depth_ = 0;
  int open_ = 0;
  bool too_deep_ = false;
  bool zero_logx_ = false;
  std::size_t logx_begin_ = 0;
  std::size_t logx_end_ = 0;
};

}  // namespace

std::optional<Weight> read_weight(Lexer lexer, const Token& first, int max_depth) {
  return WeightReader(lexer, first, max_depth).read();
}

}  // namespace sherlog
