// A thin hold on SQLite for the scene store: connections and statements that close themselves, and errors as sentences.
//
// Idea      The first error stays and makes everything after it a no-op, so that the code between a begin and a commit reads
//           straight on and asks once, at its end. Statements are prepared once for each text and kept.
// Errors    ok() and problem(): a sentence that says what to do, with SQLite's words where they help
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>

struct sqlite3;
struct sqlite3_stmt;

namespace sherlog {

class SqlDatabase;

// Filled by bind() in the order of its question marks, then stepped through; reset when it is fetched again.
class SqlStatement {
 public:
  SqlStatement(SqlDatabase& database, const char* sql);
  ~SqlStatement();
  SqlStatement(const SqlStatement&) = delete;
  SqlStatement& operator=(const SqlStatement&) = delete;

  void reset();
  SqlStatement& bind(std::int64_t number);
  SqlStatement& bind(double number);
  SqlStatement& bind(std::string_view text);
  SqlStatement& bind_null();
  SqlStatement& bind(const std::optional<std::string>& text);
  SqlStatement& bind(const std::optional<double>& number);

  // True where there is a row; false at the end and after an error.
  bool step();
  // Steps a statement that has no rows.
  void run();

  bool is_null(int column) const;
  std::int64_t whole(int column) const;
  double real(int column) const;
  std::string text(int column) const;
  std::optional<double> maybe_real(int column) const;
  std::optional<std::string> maybe_text(int column) const;

 private:
  friend class SqlDatabase;
  SqlDatabase* database_;
  sqlite3_stmt* statement_ = nullptr;
  int bound_ = 0;
};

struct SqlOpen {
  bool read_only = false;
  bool create = true;
  double wait_seconds = 2;      // for another program's lock
  std::uint64_t max_bytes = 0;  // the file does not grow beyond; 0: as large as the disk
};

class SqlDatabase {
 public:
  SqlDatabase(std::string path, const SqlOpen& how);
  ~SqlDatabase();
  SqlDatabase(const SqlDatabase&) = delete;
  SqlDatabase& operator=(const SqlDatabase&) = delete;

  bool ok() const { return problem_.empty(); }
  const std::string& problem() const { return problem_; }
  void clear_problem() { problem_.clear(); }
  // A problem of the caller's, in place of one of SQLite's.
  void refuse(std::string problem) {
    if (ok()) problem_ = std::move(problem);
  }
  // The last error was a broken UNIQUE rule.
  bool was_duplicate() const { return was_duplicate_; }

  // Asked now and then while rows are read: true ends that with a problem. For reading only: a change that is ended so takes
  // its whole transaction back. The database stays where it is in memory from then on.
  void stop_when(std::function<bool()> wants_end);
  bool was_stopped() const { return was_stopped_; }

  bool execute(const std::string& sql);
  // Prepared once; reset at each call.
  SqlStatement& statement(const char* sql);
  std::int64_t last_row() const;
  // The only number of the only row, or 0.
  std::int64_t number(const char* sql);
  bool in_transaction() const;
  const std::string& path() const { return path_; }

 private:
  friend class SqlStatement;
  void fail(int code);
  int open(int flags, const std::string& name);  // SQLite's code
  bool wants_end() const { return wants_end_ && wants_end_(); }

  std::string path_;
  SqlOpen how_;
  sqlite3* handle_ = nullptr;
  std::string problem_;
  bool was_duplicate_ = false;
  bool was_stopped_ = false;
  std::function<bool()> wants_end_;
  std::unordered_map<const char*, std::unique_ptr<SqlStatement>> statements_;
};

}  // namespace sherlog
