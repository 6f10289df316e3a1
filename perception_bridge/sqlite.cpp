#include "perception_bridge/sqlite.h"

#include <fmt/format.h>
#include <sqlite3.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <limits>

namespace sherlog {
namespace {

std::string uri_of(const std::string& path) {
  std::string uri = "file:";
  for (const char c : path) {
    if (c == '?' || c == '#' || c == '%') {
      uri += fmt::format("%{:02x}", static_cast<unsigned>(static_cast<unsigned char>(c)));
    } else {
      uri += c;
    }
  }
  return uri + "?immutable=1";
}

std::string sentence(int code, const std::string& path, double waited, const char* words) {
  switch (code & 0xff) {
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
      return fmt::format("the store '{}' is locked by another program (waited {:g} s)", path, waited);
    case SQLITE_READONLY:
      return fmt::format("the store '{}' is read-only", path);
    case SQLITE_FULL:
      return fmt::format("no room in the store '{}': the disk is full, or the store has reached its largest size",
                         path);
    case SQLITE_NOTADB:
      return fmt::format("'{}' is not a scene store", path);
    case SQLITE_CORRUPT:
      return fmt::format("the store '{}' is damaged: {}", path, words);
    case SQLITE_CANTOPEN:
      return fmt::format("cannot open the store '{}': {}", path, words);
    case SQLITE_INTERRUPT:
      return fmt::format("the store '{}' was not read to its end", path);
    case SQLITE_IOERR:
      return fmt::format("the store '{}' cannot be read or written: {}", path, words);
    default:
      return fmt::format("the store '{}': {}", path, words);
  }
}

}  // namespace

SqlStatement::SqlStatement(SqlDatabase& database, const char* sql) : database_(&database) {
  if (!database.ok()) return;
  const int code = sqlite3_prepare_v3(database.handle_, sql, -1, SQLITE_PREPARE_PERSISTENT, &statement_, nullptr);
  if (code != SQLITE_OK) database.fail(code);
}

SqlStatement::~SqlStatement() { sqlite3_finalize(statement_); }

void SqlStatement::reset() {
  bound_ = 0;
  if (statement_ == nullptr) return;  // not prepared, because of an error: its clear_bindings takes no null pointer
  sqlite3_reset(statement_);
  sqlite3_clear_bindings(statement_);
}

SqlStatement& SqlStatement::bind(std::int64_t number) {
  sqlite3_bind_int64(statement_, ++bound_, number);
  return *this;
}

SqlStatement& SqlStatement::bind(double number) {
  sqlite3_bind_double(statement_, ++bound_, number);
  return *this;
}

SqlStatement& SqlStatement::bind(std::string_view text) {
  sqlite3_bind_text64(statement_, ++bound_, text.data() == nullptr ? "" : text.data(), text.size(), SQLITE_TRANSIENT,
                      SQLITE_UTF8);
  return *this;
}

SqlStatement& SqlStatement::bind_null() {
  sqlite3_bind_null(statement_, ++bound_);
  return *this;
}

SqlStatement& SqlStatement::bind(const std::optional<std::string>& text) {
  return text ? bind(std::string_view(*text)) : bind_null();
}

SqlStatement& SqlStatement::bind(const std::optional<double>& number) { return number ? bind(*number) : bind_null(); }

bool SqlStatement::step() {
  if (!database_->ok() || statement_ == nullptr) return false;
  const int code = database_->wants_end() ? SQLITE_INTERRUPT : sqlite3_step(statement_);
  if (code == SQLITE_ROW) return true;
  if (code != SQLITE_DONE) database_->fail(code);
  sqlite3_reset(statement_);
  return false;
}

void SqlStatement::run() {
  while (step()) {
  }
}

bool SqlStatement::is_null(int column) const { return sqlite3_column_type(statement_, column) == SQLITE_NULL; }
std::int64_t SqlStatement::whole(int column) const { return sqlite3_column_int64(statement_, column); }
double SqlStatement::real(int column) const { return sqlite3_column_double(statement_, column); }

std::string SqlStatement::text(int column) const {
  const auto* bytes = reinterpret_cast<const char*>(sqlite3_column_text(statement_, column));
  if (bytes == nullptr) return {};
  return {bytes, static_cast<std::size_t>(sqlite3_column_bytes(statement_, column))};
}

std::optional<double> SqlStatement::maybe_real(int column) const {
  return is_null(column) ? std::nullopt : std::optional(real(column));
}

std::optional<std::string> SqlStatement::maybe_text(int column) const {
  return is_null(column) ? std::nullopt : std::optional(text(column));
}

SqlDatabase::SqlDatabase(std::string path, const SqlOpen& how) : path_(std::move(path)), how_(how) {
  struct stat status = {};
  const bool exists = ::stat(path_.c_str(), &status) == 0;
  if (exists && S_ISDIR(status.st_mode)) {
    problem_ = fmt::format("cannot open the store '{}': {}", path_, std::strerror(EISDIR));
  } else if (!exists && (how_.read_only || !how_.create)) {
    problem_ = fmt::format("there is no store '{}'", path_);
  } else if (exists && !how_.read_only && (status.st_mode & 0222) == 0) {
    problem_ = sentence(SQLITE_READONLY, path_, 0, "");  // root could write it, but somebody did not want that
  }
  if (!ok()) return;
  if (!how_.read_only) {
    open(SQLITE_OPEN_READWRITE | (how_.create ? SQLITE_OPEN_CREATE : 0), path_);
  } else if (const int code = open(SQLITE_OPEN_READONLY, path_) & 0xff;
             code == SQLITE_CANTOPEN || code == SQLITE_READONLY) {
    // In a folder that cannot be written there is no place for the files beside the store; without a log it can be read as
    // it is. Not where another program has locked it: it may be writing.
    struct stat log = {};
    if (::stat((path_ + "-wal").c_str(), &log) == 0 && log.st_size > 0) return;
    const std::string before = problem_;
    problem_.clear();
    if (open(SQLITE_OPEN_READONLY | SQLITE_OPEN_URI, uri_of(path_)) != SQLITE_OK) problem_ = before;
  }
}

int SqlDatabase::open(int flags, const std::string& name) {
  sqlite3_close(handle_);
  handle_ = nullptr;
  int code = sqlite3_open_v2(name.c_str(), &handle_, flags | SQLITE_OPEN_NOMUTEX, nullptr);
  if (code == SQLITE_OK) {
    sqlite3_extended_result_codes(handle_, 1);
    sqlite3_busy_timeout(handle_, static_cast<int>(std::clamp(how_.wait_seconds, 0.0, 1e6) * 1000));
    // The file is first read here: what is no database is found out.
    code = sqlite3_exec(handle_, "SELECT count(*) FROM sqlite_master; PRAGMA foreign_keys = ON;", nullptr, nullptr,
                        nullptr);
  }
  if (code != SQLITE_OK) fail(code);
  if (ok() && how_.max_bytes > 0 && !how_.read_only) {
    const std::int64_t page = std::max<std::int64_t>(number("PRAGMA page_size"), 512);
    execute(fmt::format("PRAGMA max_page_count = {}",
                        std::max<std::int64_t>(1, static_cast<std::int64_t>(how_.max_bytes) / page)));
  }
  return code;
}

void SqlDatabase::stop_when(std::function<bool()> wants_end) {
  constexpr int kSteps = 10'000;  // of SQLite's machine: well under a millisecond
  wants_end_ = std::move(wants_end);
  sqlite3_progress_handler(
      handle_, wants_end_ ? kSteps : 0,
      [](void* self) { return static_cast<const SqlDatabase*>(self)->wants_end() ? 1 : 0; }, this);
}

SqlDatabase::~SqlDatabase() {
  statements_.clear();
  sqlite3_close(handle_);
}

void SqlDatabase::fail(int code) {
  was_stopped_ = was_stopped_ || code == SQLITE_INTERRUPT;
  was_duplicate_ = code == SQLITE_CONSTRAINT_UNIQUE || code == SQLITE_CONSTRAINT_PRIMARYKEY;
  if (problem_.empty())
    problem_ = sentence(code, path_, how_.wait_seconds, handle_ ? sqlite3_errmsg(handle_) : "no memory");
}

bool SqlDatabase::execute(const std::string& sql) {
  if (!ok()) return false;
  const int code = sqlite3_exec(handle_, sql.c_str(), nullptr, nullptr, nullptr);
  if (code != SQLITE_OK) fail(code);
  return ok();
}

SqlStatement& SqlDatabase::statement(const char* sql) {
  auto& entry = statements_[sql];
  // One that could not be prepared after an error is prepared again once the error is cleared.
  if (!entry || entry->statement_ == nullptr) entry = std::make_unique<SqlStatement>(*this, sql);
  entry->reset();
  return *entry;
}

std::int64_t SqlDatabase::last_row() const { return sqlite3_last_insert_rowid(handle_); }

std::int64_t SqlDatabase::number(const char* sql) {
  SqlStatement query(*this, sql);
  return query.step() ? query.whole(0) : 0;
}

bool SqlDatabase::in_transaction() const { return handle_ != nullptr && sqlite3_get_autocommit(handle_) == 0; }

}  // namespace sherlog
