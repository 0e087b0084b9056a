#include "database.hpp"

namespace rtpm::file_store {

Statement::Statement(sqlite3* database, const char* sql) {
  sqlite3_stmt* statement = nullptr;
  static_cast<void>(sqlite3_prepare_v2(database, sql, -1, &statement, nullptr));
  statement_.reset(statement);
}

void Statement::bind(int number, std::int64_t value) noexcept {
  static_cast<void>(sqlite3_bind_int64(statement_.get(), number, value));
}

void Statement::bind(int number, std::string_view text) noexcept {
  // An empty text instead of null.
  const char* const data = text.empty() ? "" : text.data();
  static_cast<void>(
      sqlite3_bind_text64(statement_.get(), number, data, text.size(), nullptr, SQLITE_UTF8));
}

int Statement::step() noexcept {
  return statement_ == nullptr ? SQLITE_ERROR : sqlite3_step(statement_.get());
}

void Statement::reset() noexcept {
  if (statement_ != nullptr) static_cast<void>(sqlite3_reset(statement_.get()));
}

int Statement::run() noexcept {
  const int result = step();
  reset();
  return result;
}

std::int64_t Statement::integer(int column) const noexcept {
  return sqlite3_column_int64(statement_.get(), column);
}

std::string_view Statement::text(int column) const noexcept {
  const auto* const data = static_cast<const char*>(sqlite3_column_blob(statement_.get(), column));
  const int size = sqlite3_column_bytes(statement_.get(), column);
  return data == nullptr ? std::string_view{}
                         : std::string_view(data, static_cast<std::size_t>(size));
}

int Database::open(const std::string& path, const std::string& vfs) {
  sqlite3* database = nullptr;
  const int result =
      sqlite3_open_v2(path.c_str(), &database, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE,
                      vfs.empty() ? nullptr : vfs.c_str());
  database_.reset(database);
  if (database != nullptr) static_cast<void>(sqlite3_extended_result_codes(database, 1));
  return result;
}

int Database::execute(const char* sql) noexcept {
  return sqlite3_exec(database_.get(), sql, nullptr, nullptr, nullptr);
}

std::int64_t Database::integer_of(const char* sql, std::int64_t otherwise) {
  Statement statement = prepare(sql);
  return statement.step() == SQLITE_ROW ? statement.integer(0) : otherwise;
}

bool Database::has_moved() {
  int has_moved = 0;
  static_cast<void>(
      sqlite3_file_control(database_.get(), "main", SQLITE_FCNTL_HAS_MOVED, &has_moved));
  // SQLite only reports whether a log with that name exists.
  const std::string log = std::string(sqlite3_db_filename(database_.get(), "main")) + "-wal";
  sqlite3_vfs* vfs = nullptr;
  int is_there = 1;
  static_cast<void>(sqlite3_file_control(database_.get(), "main", SQLITE_FCNTL_VFS_POINTER, &vfs));
  if (vfs != nullptr) {
    static_cast<void>(vfs->xAccess(vfs, log.c_str(), SQLITE_ACCESS_EXISTS, &is_there));
  }
  return has_moved != 0 || is_there == 0;
}

std::string Database::text() const {
  return database_ == nullptr ? "out of memory" : sqlite3_errmsg(database_.get());
}

}  // namespace rtpm::file_store
