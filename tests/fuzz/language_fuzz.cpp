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
  const auto texts = sherlog::fuzz::texts_of(data, size);
  if (!texts) return 0;

  check_printer(texts->model);
  sherlog::Diagnostics diagnostics;
  const auto model = sherlog::parse_model(texts->model, "model.mln", diagnostics);
  demand(model.has_value() != diagnostics.has_errors(), "a model is returned exactly where there is no error",
         std::string(texts->model));
  if (model) {
    const auto databases = sherlog::parse_evidence(*model, texts->evidence, "evidence.db", diagnostics);
    demand(databases.has_value() != diagnostics.has_errors(), "evidence is returned exactly where there is no error",
           std::string(texts->evidence));
    if (databases) {
      for (const auto& evidence : *databases) {
        (void)sherlog::parse_query(*model, evidence, {texts->query}, diagnostics);
      }
    }
  }
  (void)diagnostics.render(true);
  return 0;
}
