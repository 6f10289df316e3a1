#include "perception_bridge/sqlite.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <limits>

namespace sherlog {
namespace {

using testing::HasSubstr;

class SqlFile : public testing::Test {
 protected:
  SqlFile() {
    std::string name = (std::filesystem::temp_directory_path() / "sherlog-sql-XXXXXX").string();
    folder_ = mkdtemp(name.data());
    path_ = (folder_ / "x.db").string();
  }
  ~SqlFile() override { std::filesystem::remove_all(folder_); }
  std::filesystem::path folder_;
  std::string path_;
};

TEST_F(SqlFile, ValuesComeOutAsTheyWentIn) {
  SqlDatabase database(path_, {});
  ASSERT_TRUE(database.execute("CREATE TABLE t(a, b, c, d)")) << database.problem();
  const std::string text = std::string("a\0b", 3) + "\xc3\xa4";
  const std::int64_t most = std::numeric_limits<std::int64_t>::max();
  database.statement("INSERT INTO t VALUES (?, ?, ?, ?)")
      .bind(most)
      .bind(0.1)
      .bind(std::string_view(text))
      .bind_null()
      .run();
  ASSERT_TRUE(database.ok()) << database.problem();
  SqlStatement& query = database.statement("SELECT a, b, c, d FROM t");
  ASSERT_TRUE(query.step());
  EXPECT_EQ(query.whole(0), most);
  EXPECT_EQ(query.real(1), 0.1);
  EXPECT_EQ(query.text(2), text);
  EXPECT_TRUE(query.is_null(3));
  EXPECT_EQ(query.maybe_text(3), std::nullopt);
  EXPECT_EQ(query.maybe_real(3), std::nullopt);
  EXPECT_EQ(query.maybe_real(1), 0.1);
  EXPECT_FALSE(query.step());
  EXPECT_TRUE(database.ok()) << "the end of the rows is no error";
  EXPECT_EQ(database.number("SELECT count(*) FROM t"), 1);
  EXPECT_EQ(database.last_row(), 1);
}

TEST_F(SqlFile, TheFirstErrorStaysAndStopsWhatFollows) {
  SqlDatabase database(path_, {});
  ASSERT_TRUE(database.execute("CREATE TABLE t(a UNIQUE)"));
  EXPECT_FALSE(database.execute("INSERT INTO nowhere VALUES (1)"));
  const std::string problem = database.problem();
  EXPECT_THAT(problem, HasSubstr("nowhere"));
  EXPECT_FALSE(database.execute("INSERT INTO t VALUES (1)"));
  EXPECT_EQ(database.problem(), problem);
  database.clear_problem();
  EXPECT_EQ(database.number("SELECT count(*) FROM t"), 0) << "nothing was done after the error";
  EXPECT_TRUE(database.execute("INSERT INTO t VALUES (1)"));
}

TEST_F(SqlFile, ADuplicateIsToldFromOtherErrors) {
  SqlDatabase database(path_, {});
  ASSERT_TRUE(database.execute("CREATE TABLE t(a UNIQUE); INSERT INTO t VALUES (1)"));
  database.statement("INSERT INTO t VALUES (?)").bind(std::int64_t{1}).run();
  EXPECT_FALSE(database.ok());
  EXPECT_TRUE(database.was_duplicate());
}

TEST_F(SqlFile, ATransactionIsThereOrNot) {
  {
    SqlDatabase database(path_, {});
    ASSERT_TRUE(database.execute("CREATE TABLE t(a)"));
    EXPECT_FALSE(database.in_transaction());
    ASSERT_TRUE(database.execute("BEGIN IMMEDIATE"));
    EXPECT_TRUE(database.in_transaction());
    ASSERT_TRUE(database.execute("INSERT INTO t VALUES (1)"));
  }  // closed without a commit
  SqlDatabase again(path_, {.read_only = true});
  EXPECT_EQ(again.number("SELECT count(*) FROM t"), 0);
  EXPECT_FALSE(again.execute("INSERT INTO t VALUES (1)"));
  EXPECT_THAT(again.problem(), HasSubstr("read-only"));
}

TEST_F(SqlFile, WhatIsNotThereIsNotMadeUnlessWanted) {
  SqlDatabase missing(path_, {.create = false});
  EXPECT_FALSE(missing.ok());
  EXPECT_FALSE(std::filesystem::exists(path_));
}

TEST_F(SqlFile, AStatementAfterAnErrorDoesNothing) {
  SqlDatabase database(path_, {});
  SqlStatement& bad = database.statement("SELECT a FROM nowhere WHERE a = ?");
  EXPECT_FALSE(bad.bind(std::int64_t{1}).step());
  EXPECT_THAT(database.problem(), HasSubstr("nowhere"));
  SqlStatement& after = database.statement("SELECT ?");
  EXPECT_FALSE(after.bind(std::string_view("x")).step());
  EXPECT_TRUE(after.is_null(0));
  EXPECT_EQ(after.text(0), "");
  database.clear_problem();
  SqlStatement& again = database.statement("SELECT ?");
  ASSERT_TRUE(again.bind(std::string_view("x")).step()) << database.problem();
  EXPECT_EQ(again.text(0), "x");
}

TEST_F(SqlFile, AReaderHeedsALock) {
  SqlDatabase writer(path_, {});
  ASSERT_TRUE(writer.execute("CREATE TABLE t(a); INSERT INTO t VALUES (1); BEGIN EXCLUSIVE; UPDATE t SET a = 2"));
  SqlDatabase reader(path_, {.read_only = true, .wait_seconds = 0.01});
  EXPECT_FALSE(reader.ok());
  EXPECT_THAT(reader.problem(), HasSubstr("locked by another program"));
  ASSERT_TRUE(writer.execute("COMMIT"));
  SqlDatabase later(path_, {.read_only = true, .wait_seconds = 0.01});
  EXPECT_EQ(later.number("SELECT a FROM t"), 2);
}

TEST_F(SqlFile, ReadingEndsWhenItIsWanted) {
  SqlDatabase database(path_, {});
  ASSERT_TRUE(database.execute("CREATE TABLE t(a); INSERT INTO t VALUES (1), (2), (3)"));
  int rows = 0;
  database.stop_when([&] { return rows == 2; });
  SqlStatement& query = database.statement("SELECT a FROM t");
  while (query.step()) ++rows;
  EXPECT_EQ(rows, 2);
  EXPECT_TRUE(database.was_stopped());
  EXPECT_THAT(database.problem(), HasSubstr("not read to its end"));
  // In the middle of one long step too.
  database.clear_problem();
  int asked = 0;
  database.stop_when([&] { return ++asked > 3; });
  EXPECT_EQ(database.number("WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < 1000000000) "
                            "SELECT count(*) FROM n"),
            0);
  EXPECT_FALSE(database.ok());
}

}  // namespace
}  // namespace sherlog
