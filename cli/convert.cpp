// sherlog convert: a model in another system's spelling; or another system's model, read with its precedence, in ours.
#include "mln/convert.h"

#include <fmt/format.h>

#include <map>
#include <memory>

#include "cli/commands.h"
#include "cli/report.h"
#include "cli/session.h"
#include "mln/parser.h"
#include "mln/printer.h"

namespace sherlog::cli {
namespace {

struct Conversion {
  std::string from = "sherlog";
  std::string to;
  std::string output = "-";
  bool inline_includes = false;
};

const std::map<std::string, Dialect> dialects = {{"sherlog", Dialect::kSherlog},
                                                 {"alchemy", Dialect::kAlchemy},
                                                 {"pracmln", Dialect::kPracmln},
                                                 {"tuffy", Dialect::kTuffy}};

int convert_model(Session& session, const Conversion& conversion) {
  Diagnostics& diagnostics = session.diagnostics();
  ParseOptions parse;
  parse.precedence = conversion.from == "pracmln" ? Precedence::kOrTighter : Precedence::kAndTighter;
  syntax::Model whole;
  for (const std::string& path : session.options().models) {
    const auto text = read_text_file(path, diagnostics);
    if (!text) break;
    syntax::Model part = parse_syntax(*text, path, diagnostics, parse);
    whole.statements.insert(whole.statements.end(), std::make_move_iterator(part.statements.begin()),
                            std::make_move_iterator(part.statements.end()));
    whole.depth.insert(whole.depth.end(), part.depth.begin(), part.depth.end());
  }
  if (!diagnostics.has_errors()) (void)resolve(whole, diagnostics);  // what cannot be understood is not rewritten
  session.print_diagnostics();
  if (diagnostics.has_errors()) return kBadInput;

  // Read with another precedence, an included file means something else as well: it is written out, too.
  const bool inline_includes = conversion.inline_includes || parse.precedence != Precedence::kAndTighter;
  const Dialect dialect = dialects.at(conversion.to);
  const std::string text =
      dialect == Dialect::kSherlog ? print(whole, dialect, inline_includes) : convert(whole, dialect, diagnostics);
  session.print_diagnostics();
  if (diagnostics.has_errors()) return kBadInput;
  if (conversion.output != "-" && !session.write(conversion.output, text)) return kInternalError;
  return session.finish(kDone, conversion.output == "-" ? text : "", [&] {
    Json json;
    json["schema"] = "sherlog.convert/1";
    json["from"] = conversion.from;
    json["to"] = conversion.to;
    json["text"] = text;
    return to_text(json);
  });
}

int run_convert(Options options, const Conversion& conversion) {
  Session session(std::move(options));
  // With --json - the document has the text.
  std::vector<std::string> outputs;
  if (conversion.output != "-") outputs.push_back(conversion.output);
  if (!session.check_options(outputs)) return kBadInput;
  return session.run("sherlog.convert/1", [&] { return convert_model(session, conversion); });
}

}  // namespace

void add_convert(CLI::App& app, Action& action) {
  auto options = std::make_shared<Options>();
  auto conversion = std::make_shared<Conversion>();
  CLI::App* command =
      app.add_subcommand("convert", "Write a model for another system, or read one with its precedence");
  add_model_options(*command, *options);
  const std::string names = "sherlog|alchemy|pracmln|tuffy";
  command->add_option("--to", conversion->to, "Whose spelling to write")
      ->type_name(names)
      ->required()
      ->check(one_of({"sherlog", "alchemy", "pracmln", "tuffy"}));
  command
      ->add_option("--from", conversion->from,
                   "Whose precedence to read with (default sherlog; in pracmln 'v' binds tighter)")
      ->type_name(names)
      ->check(one_of({"sherlog", "alchemy", "pracmln", "tuffy"}));
  command->add_option("-o,--output", conversion->output, "Where the model goes (default '-': standard output)")
      ->type_name("FILE|-");
  command->add_flag("--inline-includes", conversion->inline_includes,
                    "Write the included statements instead of #include (always so for another system)");
  add_common_options(*command, *options);
  command->callback([options, conversion, &action] {
    action = [options, conversion] { return run_convert(*options, *conversion); };
  });
}

}  // namespace sherlog::cli
