#include "tests/oracles/random_model.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>

namespace sherlog::oracle {
namespace {

struct RandomDomain {
  std::string name;
  std::vector<std::string> constants;  // those that evidence and formulas may use
  bool declared = false;
};

struct RandomPredicate {
  std::string name;
  std::vector<std::size_t> domains;
  std::vector<bool> marked;
  char mark = ' ';  // '!', '?' or none
};

// A variable in scope.
struct Scoped {
  std::string name;
  std::size_t domain;
};

class Writer {
 public:
  explicit Writer(std::mt19937_64& random) : random_(random) {}

  RandomModel write() {
    make_domains();
    make_predicates();
    const std::size_t formulas = 1 + below(4);
    for (std::size_t i = 0; i < formulas; ++i) result_.model += statement() + "\n";
    write_evidence();
    write_queries();
    return std::move(result_);
  }

 private:
  std::size_t below(std::size_t n) { return std::uniform_int_distribution<std::size_t>(0, n - 1)(random_); }
  bool chance(double p) { return std::bernoulli_distribution(p)(random_); }
  template <class T>
  const T& pick(const std::vector<T>& items) {
    return items[below(items.size())];
  }

  void make_domains() {
    const std::size_t count = 1 + below(3);
    for (std::size_t d = 0; d < count; ++d) {
      RandomDomain domain;
      domain.name = fmt::format("dom{}", d);
      const std::size_t size = chance(0.06) ? 0 : 1 + below(3);
      const bool numeric = chance(0.25);
      for (std::size_t c = 0; c < size; ++c) {
        domain.constants.push_back(numeric ? fmt::format("{}", 10 * d + c) : fmt::format("C{}{}", d, c));
      }
      domain.declared = size > 0 && chance(0.6);
      if (domain.declared)
        result_.model += fmt::format("{} = {{{}}}\n", domain.name, fmt::join(domain.constants, ", "));
      // Sometimes the evidence widens it.
      if (size > 0 && size < 3 && chance(0.1))
        domain.constants.push_back(numeric ? fmt::format("{}", 10 * d + 5) : fmt::format("C{}x", d));
      domains_.push_back(domain);
    }
  }

  void make_predicates() {
    const std::size_t count = 2 + below(3);
    for (std::size_t p = 0; p < count; ++p) {
      RandomPredicate predicate;
      predicate.name = fmt::format("{}{}", std::string(1, static_cast<char>('P' + p)), chance(0.3) ? "red" : "");
      const std::size_t arity = chance(0.12) ? 3 : 1 + below(2);
      for (std::size_t i = 0; i < arity; ++i) predicate.domains.push_back(below(domains_.size()));
      predicate.marked.assign(arity, false);
      if (chance(0.4)) {
        predicate.mark = chance(0.6) ? '!' : '?';
        predicate.marked[below(arity)] = true;
        if (arity >= 2 && chance(0.25)) predicate.marked[below(arity)] = true;
      }
      std::vector<std::string> arguments;
      for (std::size_t i = 0; i < arity; ++i) {
        arguments.push_back(domains_[predicate.domains[i]].name +
                            (predicate.marked[i] ? std::string(1, predicate.mark) : ""));
      }
      result_.model += fmt::format("{}{}({})\n", chance(0.15) ? "*" : "", predicate.name, fmt::join(arguments, ", "));
      predicates_.push_back(predicate);
    }
  }

  // --- formulas

  std::string constant_or(std::size_t domain, const std::string& variable) {
    const auto& constants = domains_[domain].constants;
    if (constants.empty() || !domains_[domain].declared || !chance(0.3)) return variable;
    return pick(constants);
  }

  // A variable of the scope with this domain, or a new outer one.
  std::string variable(std::size_t domain, const std::vector<Scoped>& scope) {
    std::vector<std::string> fitting;
    for (const Scoped& v : scope) {
      if (v.domain == domain) fitting.push_back(v.name);
    }
    for (const Scoped& v : outer_) {
      if (v.domain == domain) fitting.push_back(v.name);
    }
    if (!fitting.empty() && (outer_.size() >= 3 || chance(0.7))) return pick(fitting);
    outer_.push_back({fmt::format("{}v{}", sigil_, outer_.size()), domain});
    return outer_.back().name;
  }

  std::string atom(const std::vector<Scoped>& scope) {
    const RandomPredicate& predicate = pick(predicates_);
    std::vector<std::string> terms;
    for (std::size_t domain : predicate.domains) {
      std::string name = variable(domain, scope);
      const std::string term = constant_or(domain, name);
      if (term == name) in_atoms_.insert(name);
      terms.push_back(term);
    }
    const bool star = stars_ < 1 && chance(0.04);
    stars_ += star ? 1 : 0;
    return fmt::format("{}{}({})", star ? "*" : "", predicate.name, fmt::join(terms, ", "));
  }

  std::string comparison(const std::vector<Scoped>& scope) {
    std::vector<Scoped> all = outer_;
    all.insert(all.end(), scope.begin(), scope.end());
    if (all.empty()) return atom(scope);
    const Scoped left = pick(all);
    const auto& constants = domains_[left.domain].constants;
    std::string right;
    for (const Scoped& v : all) {
      if (v.domain == left.domain && v.name != left.name) right = v.name;
    }
    if (right.empty() || chance(0.3)) {
      if (constants.empty() || !domains_[left.domain].declared) return atom(scope);
      right = pick(constants);
    }
    used_in_comparisons_.insert(left.name);
    used_in_comparisons_.insert(right);
    const bool numeric = !constants.empty() && constants.front().front() != 'C';
    static const std::vector<std::string> kSigns = {"=", "!=", "<", "<=", ">", ">="};
    return fmt::format("({} {} {})", left.name, kSigns[below(numeric ? 6 : 2)], right);
  }

  std::string quantified(int depth, const std::vector<Scoped>& scope) {
    std::vector<Scoped> inner = scope;
    const std::size_t count = chance(0.25) ? 2 : 1;
    std::vector<std::string> names;
    for (std::size_t i = 0; i < count; ++i) {
      // A domain that some predicate has, so that an atom can type the variable.
      const std::size_t domain = pick(pick(predicates_).domains);
      inner.push_back({fmt::format("{}q{}", sigil_, quantifiers_++), domain});
      names.push_back(inner.back().name);
    }
    const std::string body = formula(depth - 1, inner);
    for (const std::string& name : names) untyped_ = untyped_ || !in_atoms_.contains(name);
    return fmt::format("{} {} ({})", chance(0.7) ? "EXIST" : "FORALL", fmt::join(names, ", "), body);
  }

  std::string formula(int depth, const std::vector<Scoped>& scope) {
    if (depth <= 0) {
      const std::string text = chance(0.12) ? comparison(scope) : atom(scope);
      return chance(0.35) ? "!" + text : text;
    }
    const double which = std::uniform_real_distribution<double>(0, 1)(random_);
    if (which < 0.18) return quantified(depth, scope);
    if (which < 0.25) return "!(" + formula(depth - 1, scope) + ")";
    const std::string left = formula(depth - 1, scope);
    const std::string right = formula(depth - 1 - static_cast<int>(below(2)), scope);
    const char* connective = which < 0.47 ? "^" : which < 0.72 ? "v" : which < 0.89 ? "=>" : "<=>";
    return fmt::format("({}) {} ({})", left, connective, right);
  }

  // A formula all of whose variables have a domain from some atom.
  std::string typed_formula(int depth) {
    while (true) {
      outer_.clear();
      in_atoms_.clear();
      used_in_comparisons_.clear();
      untyped_ = false;
      quantifiers_ = 0;
      stars_ = 0;
      const std::string text = formula(depth, {});
      for (const std::string& name : used_in_comparisons_) {
        const bool is_variable = name.front() == '?' || name.front() == 'v' || name.front() == 'q';
        untyped_ = untyped_ || (is_variable && !in_atoms_.contains(name));
      }
      if (!untyped_) return text;
    }
  }

  std::string weight() {
    if (chance(0.1)) return fmt::format("log({:.2f})", std::uniform_real_distribution<double>(0.05, 4)(random_));
    if (chance(0.06)) return fmt::format("{:.2f}", std::uniform_real_distribution<double>(-40, 40)(random_));
    return fmt::format("{:.2f}", std::uniform_real_distribution<double>(-3, 3)(random_));
  }

  std::string statement() {
    if (chance(0.1)) return unique_statement();
    if (chance(0.1)) {
      const std::string rule = rule_with_exceptions();
      if (!rule.empty()) return rule;
    }
    if (chance(0.22)) {  // hard: a clause, most of the time, so that worlds are left
      sigil_ = "";
      return typed_formula(chance(0.8) ? 1 : 2) + ".";
    }
    sigil_ = chance(0.2) ? "?" : "";
    std::string text = typed_formula(1 + static_cast<int>(below(3)));
    if (chance(0.2)) add_plus(text);
    return weight() + " " + text;
  }

  // Puts a + before one outer variable, where it stands in an atom.
  void add_plus(std::string& text) {
    std::vector<std::string> candidates;
    for (const Scoped& v : outer_) {
      if (in_atoms_.contains(v.name)) candidates.push_back(v.name);
    }
    if (candidates.empty()) return;
    const std::string name = pick(candidates);
    for (const std::string& before : {std::string("("), std::string(", ")}) {
      for (const std::string& after : {std::string(")"), std::string(",")}) {
        const std::size_t at = text.find(before + name + after);
        // A bracket that opens an argument list follows a letter.
        if (at == std::string::npos ||
            (before == "(" && (at == 0 || !std::isalnum(static_cast<unsigned char>(text[at - 1])))))
          continue;
        text.insert(at + before.size(), "+");
        return;
      }
    }
  }

  std::string unique_statement() {
    const RandomPredicate& predicate = pick(predicates_);
    const std::size_t position = below(predicate.domains.size());
    const auto mention = [&](const std::string& name) {
      std::vector<std::string> terms;
      for (std::size_t i = 0; i < predicate.domains.size(); ++i) {
        terms.push_back(i == position ? "+" + name : fmt::format("?w{}", i));
      }
      return fmt::format("{}({})", predicate.name, fmt::join(terms, ", "));
    };
    return fmt::format("#unique{{+?a, +?b}}\n{} {} {} {}", weight(), mention("?a"), chance(0.5) ? "^" : "v",
                       mention("?b"));
  }

  // A hard rule about all values of a '!' block but some: P(x, e) ^ e != C ... => something. Empty where no predicate fits.
  std::string rule_with_exceptions() {
    std::vector<RandomPredicate> fitting;
    for (const RandomPredicate& predicate : predicates_) {
      if (predicate.mark != '!' || std::ranges::count(predicate.marked, true) != 1) continue;
      const auto position = std::ranges::find(predicate.marked, true) - predicate.marked.begin();
      if (domains_[predicate.domains[static_cast<std::size_t>(position)]].declared) fitting.push_back(predicate);
    }
    if (fitting.empty()) return "";
    const RandomPredicate& predicate = pick(fitting);
    std::vector<std::string> body;
    const auto mention = [&](const std::string& first, const std::string& value) {
      std::vector<std::string> terms;
      for (std::size_t i = 0; i < predicate.domains.size(); ++i) {
        terms.push_back(predicate.marked[i]                 ? value
                        : i + 1 == predicate.domains.size() ? first
                                                            : fmt::format("?m{}", i));
        if (!predicate.marked[i]) continue;
        for (std::size_t n = 1 + below(2); n > 0; --n)
          body.push_back(fmt::format("{} != {}", value, pick(domains_[predicate.domains[i]].constants)));
      }
      body.push_back(fmt::format("{}({})", predicate.name, fmt::join(terms, ", ")));
    };
    mention("?x", "?e");
    const bool two = predicate.domains.size() > 1 && !predicate.marked.back() && chance(0.6);
    if (two) mention("?y", chance(0.15) ? "?e" : "?f");
    std::ranges::shuffle(body, random_);
    const RandomPredicate& other = pick(predicates_);
    std::vector<std::string> terms;
    for (std::size_t i = 0; i < other.domains.size(); ++i) terms.push_back(fmt::format("?o{}", i));
    return fmt::format("{} => {}.", fmt::join(body, " ^ "),
                       two ? "?x = ?y" : fmt::format("{}({})", other.name, fmt::join(terms, ", ")));
  }

  // --- evidence

  std::vector<std::vector<std::string>> atoms_of(const RandomPredicate& predicate) {
    std::vector<std::vector<std::string>> rows{{}};
    for (std::size_t domain : predicate.domains) {
      std::vector<std::vector<std::string>> longer;
      for (const auto& row : rows) {
        for (const std::string& constant : domains_[domain].constants) {
          longer.push_back(row);
          longer.back().push_back(constant);
        }
      }
      rows = std::move(longer);
    }
    return rows;
  }

  void state(const std::string& sign, const RandomPredicate& predicate, const std::vector<std::string>& arguments) {
    lines_.push_back(fmt::format("{}{}({})", sign, predicate.name, fmt::join(arguments, ",")));
  }

  std::string degree() { return fmt::format("{:.2f} ", std::uniform_real_distribution<double>(0.05, 0.95)(random_)); }

  bool is_used(const RandomDomain& domain) const {
    return std::ranges::any_of(predicates_, [&](const RandomPredicate& predicate) {
      return std::ranges::any_of(predicate.domains, [&](std::size_t d) { return &domains_[d] == &domain; });
    });
  }

  void write_evidence() {
    const double stated = std::uniform_real_distribution<double>(0.1, 0.8)(random_);
    for (const RandomDomain& domain : domains_) {
      // Constants that nothing else mentions are still constants.
      if (!domain.constants.empty() && is_used(domain))
        lines_.push_back(fmt::format("{} = {{{}}}", domain.name, fmt::join(domain.constants, ", ")));
    }
    for (const RandomPredicate& predicate : predicates_) {
      if (predicate.mark != ' ') {
        write_blocks(predicate, stated);
        continue;
      }
      for (const auto& arguments : atoms_of(predicate)) {
        if (!chance(stated)) continue;
        const double which = std::uniform_real_distribution<double>(0, 1)(random_);
        state(which < 0.45 ? "" : which < 0.7 ? "!" : which < 0.85 ? "?" : degree(), predicate, arguments);
      }
    }
    std::shuffle(lines_.begin(), lines_.end(), random_);
    result_.evidence = fmt::format("{}\n", fmt::join(lines_, "\n"));
  }

  // Never against the rules: at most one true value, and a '!' block keeps one that is not denied.
  void write_blocks(const RandomPredicate& predicate, double stated) {
    std::vector<std::pair<std::vector<std::string>, std::vector<std::vector<std::string>>>> blocks;
    for (const auto& arguments : atoms_of(predicate)) {
      std::vector<std::string> key;
      for (std::size_t i = 0; i < arguments.size(); ++i) {
        if (!predicate.marked[i]) key.push_back(arguments[i]);
      }
      auto found = std::ranges::find(blocks, key, [](const auto& block) { return block.first; });
      if (found == blocks.end()) found = blocks.insert(blocks.end(), {key, {}});
      found->second.push_back(arguments);
    }
    for (auto& [key, atoms] : blocks) {
      if (!chance(stated)) continue;
      std::shuffle(atoms.begin(), atoms.end(), random_);
      const bool has_true = chance(0.3);
      for (std::size_t i = 0; i < atoms.size(); ++i) {
        if (i == 0) {
          if (has_true) state("", predicate, atoms[i]);
          if (!has_true && chance(0.3)) state(chance(0.5) ? "?" : degree(), predicate, atoms[i]);
        } else if (chance(0.5)) {
          const double which = std::uniform_real_distribution<double>(0, 1)(random_);
          state(which < 0.6 ? "!" : which < 0.75 ? "?" : degree(), predicate, atoms[i]);
        }
      }
    }
  }

  // --- queries

  void write_queries() {
    sigil_ = "";
    const std::size_t count = 1 + below(3);
    for (std::size_t i = 0; i < count; ++i) {
      const RandomPredicate& predicate = pick(predicates_);
      const auto atoms = atoms_of(predicate);
      const double which = std::uniform_real_distribution<double>(0, 1)(random_);
      if (which < 0.45 || atoms.empty()) {
        result_.queries.push_back(predicate.name);
      } else if (which < 0.6) {
        result_.queries.push_back(fmt::format("{}({})", predicate.name, fmt::join(pick(atoms), ",")));
      } else if (which < 0.8) {
        std::vector<std::string> arguments = pick(atoms);
        if (arguments.size() > 1 && predicate.domains.front() == predicate.domains.back() && chance(0.4)) {
          arguments.front() = arguments.back() = "?x";
        } else {
          arguments[below(arguments.size())] = "?x";
        }
        result_.queries.push_back(fmt::format("{}({})", predicate.name, fmt::join(arguments, ",")));
      } else {
        result_.queries.push_back(ground_query(atoms, predicate));
      }
    }
    if (chance(0.3)) result_.open_world.push_back(pick(predicates_).name);
    result_.open_world_all = chance(0.25);
  }

  std::string ground_query(const std::vector<std::vector<std::string>>& atoms, const RandomPredicate& predicate) {
    const auto text = [&] { return fmt::format("{}({})", predicate.name, fmt::join(pick(atoms), ",")); };
    if (chance(0.4)) {
      std::vector<std::string> names;
      for (std::size_t i = 0; i < predicate.domains.size(); ++i) names.push_back(fmt::format("?z{}", i));
      return fmt::format("{} {} ({}({}))", chance(0.5) ? "EXIST" : "FORALL", fmt::join(names, ", "), predicate.name,
                         fmt::join(names, ","));
    }
    static const std::vector<std::string> kConnectives = {"^", "v", "=>", "<=>"};
    return fmt::format("{} {} !{}", text(), pick(kConnectives), text());
  }

  std::mt19937_64& random_;
  RandomModel result_;
  std::vector<RandomDomain> domains_;
  std::vector<RandomPredicate> predicates_;
  std::vector<std::string> lines_;
  // Of the formula that is being written:
  std::string sigil_;  // "?" or "", before its variables
  std::vector<Scoped> outer_;
  std::set<std::string> in_atoms_, used_in_comparisons_;
  bool untyped_ = false;
  std::size_t quantifiers_ = 0, stars_ = 0;
};

}  // namespace

RandomModel random_model(std::mt19937_64& random) { return Writer(random).write(); }

}  // namespace sherlog::oracle
