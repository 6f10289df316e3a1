#include "mln/lexer.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace sherlog {
namespace {

std::vector<std::string> texts(std::string_view text, Lexer::Mode mode = Lexer::Mode::kNames) {
  Lexer lexer(text);
  std::vector<std::string> result;
  for (Token token = lexer.next(mode); token.kind != TokenKind::kEnd; token = lexer.next(mode)) {
    result.emplace_back(token.text);
  }
  return result;
}

using Texts = std::vector<std::string>;

TEST(Lexer, JoinsNamesOnlyBetweenNameCharacters) {
  EXPECT_EQ(texts("ja!_ COR_500.000_ Kellogg's Voll-_Milch_ 91_a"),
            (Texts{"ja!_", "COR_500.000_", "Kellogg's", "Voll-_Milch_", "91_a"}));
  EXPECT_EQ(texts("a!=b"), (Texts{"a", "!=", "b"}));
  EXPECT_EQ(texts("P(o,e!)"), (Texts{"P", "(", "o", ",", "e", "!", ")"}));
  EXPECT_EQ(texts("Q(A)."), (Texts{"Q", "(", "A", ")", "."}));
  EXPECT_EQ(texts("a=b."), (Texts{"a", "=", "b", "."}));
  EXPECT_EQ(texts("P(a)-Q"), (Texts{"P", "(", "a", ")", "-", "Q"}));
}

TEST(Lexer, KeepsADotOutOfANumberUnlessADigitFollows) {
  EXPECT_EQ(texts("0.5 1e-3 7."), (Texts{"0.5", "1e-3", "7", "."}));
  EXPECT_EQ(texts("{0,...,5}"), (Texts{"{", "0", ",", "...", ",", "5", "}"}));
}

TEST(Lexer, SeparatesDifferencesInArithmetic) {
  EXPECT_EQ(texts("2-1", Lexer::Mode::kNames), (Texts{"2-1"}));
  EXPECT_EQ(texts("2-1", Lexer::Mode::kArithmetic), (Texts{"2", "-", "1"}));
  EXPECT_EQ(texts("0.5!P", Lexer::Mode::kArithmetic), (Texts{"0.5", "!", "P"}));
}

TEST(Lexer, SkipsCommentsAndSeesLineBreaksInThem) {
  Lexer lexer("a // ... x\n /* ... \n */ b /* c */ d");
  EXPECT_TRUE(lexer.next().line_break);
  const Token b = lexer.next();
  EXPECT_EQ(b.text, "b");
  EXPECT_TRUE(b.line_break);
  EXPECT_EQ(b.line, 3u);
  EXPECT_EQ(b.column, 5u);
  EXPECT_FALSE(lexer.next().line_break);
}

TEST(Lexer, CountsColumnsInCodePointsAfterAByteOrderMark) {
  Lexer lexer("\xEF\xBB\xBFGr\u00fc\u00dfe \u2227 x\r\ny");
  const Token word = lexer.next();
  EXPECT_EQ(word.text, "Gr\u00fc\u00dfe");
  EXPECT_EQ(word.column, 1u);
  EXPECT_EQ(lexer.next().column, 7u);
  EXPECT_EQ(lexer.next().column, 9u);
  EXPECT_EQ(lexer.next().line, 2u);
}

TEST(Lexer, ReadsTheSymbolsOfLogic) {
  Lexer lexer("\u00AC \u2227 \u2228 \u2192 \u2194 \u2203 \u2200 =/= :- <=>");
  for (const TokenKind kind :
       {TokenKind::kNot, TokenKind::kAnd, TokenKind::kOr, TokenKind::kImplies, TokenKind::kIff, TokenKind::kExists,
        TokenKind::kForall, TokenKind::kNotEqual, TokenKind::kIf, TokenKind::kIff}) {
    EXPECT_EQ(lexer.next().kind, kind);
  }
}

TEST(Lexer, MarksWhatItCannotRead) {
  EXPECT_EQ(Lexer("\"abc\nP").next().kind, TokenKind::kUnclosedString);
  EXPECT_EQ(Lexer("/* abc\nP").next().kind, TokenKind::kUnclosedComment);
  EXPECT_EQ(Lexer("/*/").next().kind, TokenKind::kUnclosedComment);
  EXPECT_EQ(Lexer("$").next().kind, TokenKind::kStray);
  EXPECT_EQ(describe(Lexer("\xFF").next()), "byte 0xFF");
  EXPECT_EQ(describe(Lexer(std::string_view("\0", 1)).next()), "byte 0x00");
}

TEST(Lexer, FindsTheLineOfDashesBetweenDatabases) {
  EXPECT_EQ(Lexer("---\nP(A)").next().kind, TokenKind::kSeparator);
  EXPECT_EQ(Lexer("---P(A)").next().kind, TokenKind::kMinus);
}

TEST(Lexer, ReadsATokenAgainAfterRewinding) {
  Lexer lexer("a\n 2-1 b");
  lexer.next();
  const Token joined = lexer.next();
  lexer.rewind(joined);
  const Token number = lexer.next(Lexer::Mode::kArithmetic);
  EXPECT_EQ(number.text, "2");
  EXPECT_EQ(number.column, joined.column);
  EXPECT_TRUE(number.line_break);
  lexer.resume_after(joined);
  EXPECT_EQ(lexer.next().text, "b");
}

TEST(Quoting, IsUndoneByUnquoting) {
  for (const std::string text : {"Dr Oetker", "a\"b", "C:\\temp", "\\\"", "", "\\"}) {
    EXPECT_EQ(unquoted(in_quotes(text)), text);
  }
  EXPECT_EQ(unquoted("\"C:\\temp\""), "C:\\temp");  // other backslashes stand for themselves
  EXPECT_EQ(quoted_if_needed("ja!_"), "ja!_");
  EXPECT_EQ(quoted_if_needed("-5"), "-5");
  EXPECT_EQ(quoted_if_needed("a b"), "\"a b\"");
  EXPECT_EQ(quoted_if_needed(""), "\"\"");
}

TEST(Utf8, RefusesOverlongFormsAndSurrogates) {
  EXPECT_EQ(find_invalid_utf8("Gr\u00fc\u00dfe \U0001F600"), std::string::npos);
  EXPECT_EQ(find_invalid_utf8("a\xC0\x80"), 1u);
  EXPECT_EQ(find_invalid_utf8("ab\xED\xA0\x80"), 2u);
  EXPECT_EQ(find_invalid_utf8("abc\xE2\x82"), 3u);
}

}  // namespace
}  // namespace sherlog
