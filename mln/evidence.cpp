// Evidence as a value, and how files become databases. The scanner is evidence_reader.cpp, the rules are
// evidence_builder.cpp.
#include "mln/evidence.h"

#include <fmt/format.h>

#include <utility>

#include "mln/evidence_builder.h"
#include "mln/evidence_reader.h"
#include "mln/lexer.h"
#include "mln/parser.h"

namespace sherlog {

Evidence::Evidence(const Model& model)
    : predicates_(model.predicates().size()),
      added_(model.domains().size()),
      added_index_(model.domains().size()),
      sources_(std::make_shared<const Sources>()) {}

const std::string& Evidence::constant_name(const Model& model, DomainId domain, ConstantIndex constant) const {
  const std::vector<std::string>& known = model.domain(domain).constants;
  return constant < known.size() ? known[constant] : added_[domain.index()][constant - known.size()];
}

std::optional<ConstantIndex> Evidence::find_constant(const Model& model, DomainId domain, std::string_view name) const {
  if (const std::optional<ConstantIndex> known = model.domain(domain).find(name)) return known;
  const auto entry = added_index_[domain.index()].find(std::string(name));
  if (entry == added_index_[domain.index()].end()) return std::nullopt;
  return entry->second;
}

namespace {

struct EvidenceText {
  std::uint32_t file = 0;
  std::vector<EvidenceSection> sections;
};

std::optional<std::vector<Evidence>> read_databases(const std::vector<EvidenceText>& texts, EvidenceContext& context,
                                                    std::size_t errors_before) {
  const Sources& sources = context.diagnostics().sources();
  const EvidenceText* several = nullptr;
  for (const EvidenceText& text : texts) {
    if (text.sections.size() == 1) continue;
    if (several != nullptr) {
      context.diagnostics().error("databases", Place{text.file, 0, 0, 1},
                                  fmt::format("file has {} databases, but '{}' has several too; one file at most can",
                                              text.sections.size(), sources.name(several->file)));
      return std::nullopt;
    }
    several = &text;
  }
  EvidenceBuilder common(context);
  for (const EvidenceText& text : texts) {
    if (&text != several) read_evidence(sources.text(text.file), text.file, text.sections[0], context, common);
  }
  std::vector<Evidence> databases;
  if (several == nullptr) {
    databases.push_back(std::move(common).finish());
  } else {
    for (const EvidenceSection& section : several->sections) {
      EvidenceBuilder database = common;
      read_evidence(sources.text(several->file), several->file, section, context, database);
      databases.push_back(std::move(database).finish());
    }
  }
  if (context.diagnostics().error_count() > errors_before) return std::nullopt;
  return databases;
}

}  // namespace

std::optional<std::vector<Evidence>> parse_evidence(const Model& model, std::string_view text, const std::string& name,
                                                    Diagnostics& diagnostics, const EvidenceOptions& options) {
  const std::size_t errors_before = diagnostics.error_count();
  EvidenceContext context(model, diagnostics, options);
  const std::uint32_t file = diagnostics.sources().add(name, std::string(text));
  return read_databases({{file, split_databases(diagnostics.sources().text(file))}}, context, errors_before);
}

std::optional<std::vector<Evidence>> parse_evidence_files(const Model& model, const std::vector<std::string>& paths,
                                                          Diagnostics& diagnostics, const EvidenceOptions& options) {
  const std::size_t errors_before = diagnostics.error_count();
  EvidenceContext context(model, diagnostics, options);
  std::vector<EvidenceText> texts;
  for (const std::string& path : paths) {
    std::optional<std::string> text = read_text_file(path, diagnostics);
    if (!text) continue;
    const std::uint32_t file = diagnostics.sources().add(path, std::move(*text));
    texts.push_back({file, split_databases(diagnostics.sources().text(file))});
  }
  return read_databases(texts, context, errors_before);
}

std::string quoted_constant(std::string_view constant) { return quoted_if_needed(constant); }

std::string atom_text(const Model& model, const Evidence& evidence, PredicateId id,
                      std::span<const ConstantIndex> arguments) {
  const Predicate& predicate = model.predicate(id);
  std::string text = predicate.name + "(";
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    if (i > 0) text += ',';
    text += quoted_constant(evidence.constant_name(model, predicate.domains[i], arguments[i]));
  }
  return text + ")";
}

}  // namespace sherlog
