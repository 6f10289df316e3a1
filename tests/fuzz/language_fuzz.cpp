// Fuzzes the whole language: whatever the bytes are, parsing ends with a value or with diagnostics that render.
//
// The input is up to three texts with a 0x1f byte between them: a model, a database and a query. What parses is printed and
// parsed again: the second text must be the first one's equal (the printer's identity).
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <string_view>

#include "mln/evidence.h"
#include "mln/model.h"
#include "mln/parser.h"
#include "mln/printer.h"
#include "mln/query.h"
#include "tests/fuzz/texts.h"

namespace {

using sherlog::fuzz::demand;
using sherlog::fuzz::take_part;

void check_printer(std::string_view text) {
  sherlog::Diagnostics diagnostics;
  sherlog::ParseOptions options;
  options.follow_includes = false;
  const auto parsed = sherlog::parse_syntax(text, "model.mln", diagnostics, options);
  if (diagnostics.has_errors()) return;
  const std::string once = sherlog::print(parsed);
  sherlog::Diagnostics again;
  const auto reparsed = sherlog::parse_syntax(once, "printed.mln", again, options);
  demand(!again.has_errors(), "a printed model parses", once + "\n--- messages:\n" + again.render());
  demand(sherlog::print(reparsed) == once, "printing a printed model changes nothing", once);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  std::string_view rest(reinterpret_cast<const char*>(data), size);
  const std::string_view model_text = take_part(rest);
  const std::string_view evidence_text = take_part(rest);
  const std::string query_text(take_part(rest));
  if (model_text.find("#include") != std::string_view::npos) return 0;  // no files of this machine

  check_printer(model_text);
  sherlog::Diagnostics diagnostics;
  const auto model = sherlog::parse_model(model_text, "model.mln", diagnostics);
  demand(model.has_value() != diagnostics.has_errors(), "a model is returned exactly where there is no error",
         std::string(model_text));
  if (model) {
    const auto databases = sherlog::parse_evidence(*model, evidence_text, "evidence.db", diagnostics);
    demand(databases.has_value() != diagnostics.has_errors(), "evidence is returned exactly where there is no error",
           std::string(evidence_text));
    if (databases) {
      for (const auto& evidence : *databases) {
        (void)sherlog::parse_query(*model, evidence, {query_text}, diagnostics);
      }
    }
  }
  (void)diagnostics.render(true);
  return 0;
}
