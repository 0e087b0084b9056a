#pragma once

#include <sqlite3.h>

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

namespace rtpm::file_store {

struct CloseDatabase {
  void operator()(sqlite3* database) const noexcept { sqlite3_close_v2(database); }
};
struct FinalizeStatement {
  void operator()(sqlite3_stmt* statement) const noexcept { sqlite3_finalize(statement); }
};

/// A prepared statement. As in SQLite, columns count from 0 and parameters from 1.
class Statement {
 public:
  Statement() = default;
  Statement(sqlite3* database, const char* sql);
  [[nodiscard]] explicit operator bool() const noexcept { return statement_ != nullptr; }

  void bind(int number, std::int64_t value) noexcept;
  /// @ownership `text` must stay valid until reset()
  void bind(int number, std::string_view text) noexcept;
  /// Returns SQLITE_ROW, SQLITE_DONE or an error.
  [[nodiscard]] int step() noexcept;
  void reset() noexcept;
  /// Runs a statement without rows. Returns SQLITE_DONE or an error.
  [[nodiscard]] int run() noexcept;

  [[nodiscard]] std::int64_t integer(int column) const noexcept;
  [[nodiscard]] std::string_view text(int column) const noexcept;

 private:
  std::unique_ptr<sqlite3_stmt, FinalizeStatement> statement_{};
};

/// An open database.
class Database {
 public:
  /// Returns SQLITE_OK or an error; text() describes it.
  [[nodiscard]] int open(const std::string& path, const std::string& vfs);
  void close() noexcept { database_.reset(); }
  [[nodiscard]] bool is_open() const noexcept { return database_ != nullptr; }
  [[nodiscard]] sqlite3* get() const noexcept { return database_.get(); }

  [[nodiscard]] int execute(const char* sql) noexcept;
  [[nodiscard]] Statement prepare(const char* sql) { return {database_.get(), sql}; }
  /// The integer in the only row of a query; `otherwise` if there is no row.
  [[nodiscard]] std::int64_t integer_of(const char* sql, std::int64_t otherwise);
  /// Whether the database file is no longer at its path, or its log is gone. Call it after a write.
  [[nodiscard]] bool has_moved();
  /// The last error in words.
  [[nodiscard]] std::string text() const;

 private:
  std::unique_ptr<sqlite3, CloseDatabase> database_{};
};

}  // namespace rtpm::file_store
