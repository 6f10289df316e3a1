// What a parser finds in a .mln text: names and places, nothing resolved yet.
//
// Precedence, tightest first: ! ; ^ ; v ; => (right-associative) ; <=> ; :- . Every node knows its place. The trees are
// built and walked without recursion deeper than the parser's own bound (see parser.h), so that an input nested 100,000
// deep is an error message and not a stack overflow.
#pragma once

#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "mln/diagnostics.h"

namespace sherlog::syntax {

struct Term {
  enum class Kind : std::uint8_t {
    kIdentifier,  // variable or constant: decided when the argument's domain is known
    kVariable,    // ?x
    kQuoted,      // "Dr Oetker": always a constant
    kNumber,      // always a constant
  };
  Kind kind = Kind::kIdentifier;
  std::string name;   // without ? and quotes
  bool plus = false;  // +x
  Place place;
};

enum class Kind : std::uint8_t {
  kAtom,      // name(terms)
  kStarAtom,  // *name(terms): stands for both signs
  kEqual,     // terms[0] = terms[1]
  kNotEqual,  // =/= and !=
  kLess,
  kLessEqual,
  kGreater,
  kGreaterEqual,
  kNot,
  kAnd,      // n-ary
  kOr,       // n-ary
  kImplies,  // binary
  kIff,      // binary
  kExists,
  kForall,
};

struct Formula {
  Kind kind = Kind::kAtom;
  Place place;                    // of the operator or the atom
  std::string name;               // predicate
  std::vector<Term> terms;        // atom's arguments, sides of a comparison, or quantified variables
  std::vector<Formula> children;  // operands
  bool bracketed = false;         // written in brackets: silences the warning about mixed connectives
};

struct DomainDeclaration {
  std::string name;
  std::vector<Term> constants;
  bool range = false;  // {0, ..., 551}: constants holds both ends
  Place place;
};

struct Argument {
  std::string domain;
  char mark = 0;  // '!', '?' or 0
  Place place;
};

struct PredicateDeclaration {
  std::string name;
  std::vector<Argument> arguments;
  bool closed = false;  // *name(...)
  Place place;
};

struct WeightedFormula {
  std::optional<double> weight;     // evaluated
  std::string weight_text;          // as written, for the printer
  bool hard = false;                // ended in '.'
  bool negated = false;             // logx(0): hard, and negated
  bool fixed = false;               // #fixweight or @w
  std::vector<std::string> unique;  // #unique{+a,+b}: the names
  Formula formula;
  Place place;
};

struct Include {
  std::string file;
  Place place;
};

using Statement = std::variant<DomainDeclaration, PredicateDeclaration, WeightedFormula, Include>;

// A file's statements in order. An include is followed by the statements of the file it names (so that the flat list is
// the whole model); `depth` says how many includes enclose each statement: 0 = written in the file itself.
struct Model {
  std::vector<Statement> statements;
  std::vector<int> depth;
};

}  // namespace sherlog::syntax
