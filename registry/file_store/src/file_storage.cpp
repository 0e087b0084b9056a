#include "rtpm/file_store/file_storage.hpp"

#include <algorithm>
#include <utility>

#include "database.hpp"
#include "encoding.hpp"
#include "row.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/host.hpp"
#include "rtpm/rt/utc.hpp"

namespace rtpm::file_store {
namespace {

using names::StorageError;
using names::StoredName;

/// "RTPM", so that no other program's database is accepted.
constexpr std::int64_t kApplicationId = 0x5254'504d;
constexpr std::int64_t kSchemaVersion = 1;
/// Skips the revisions of leased names that a power failure may have lost.
constexpr std::uint64_t kRevisionsPerStart = std::uint64_t{1} << 20;
/// How many rows to try after a damaged page.
constexpr int kSkippedRowMax = 100'000;

/// Leased names whose lease ended, and when, in nanoseconds since 1970. The first change creates
/// the table, because databases of earlier releases lack it.
constexpr const char* kCreateLapsed =
    "CREATE TABLE IF NOT EXISTS lapsed(id INTEGER PRIMARY KEY, name TEXT UNIQUE NOT NULL, "
    "url TEXT NOT NULL, interface TEXT NOT NULL, owner_id INTEGER NOT NULL, "
    "owner_epoch INTEGER NOT NULL, revision INTEGER NOT NULL, change INTEGER NOT NULL, "
    "host INTEGER NOT NULL, lease_ns INTEGER NOT NULL, properties BLOB NOT NULL, "
    "checksum INTEGER NOT NULL, ended_ns INTEGER NOT NULL);";

constexpr const char* kCheckPlace = "check its folder, rights and space";
constexpr const char* kCreate =
    "BEGIN IMMEDIATE;"
    "CREATE TABLE names(id INTEGER PRIMARY KEY, name TEXT UNIQUE NOT NULL, url TEXT NOT NULL, "
    "interface TEXT NOT NULL, owner_id INTEGER NOT NULL, owner_epoch INTEGER NOT NULL, "
    "revision INTEGER NOT NULL, change INTEGER NOT NULL, host INTEGER NOT NULL, "
    "lease_ns INTEGER NOT NULL, properties BLOB NOT NULL, checksum INTEGER NOT NULL);"
    "CREATE TABLE facts(id INTEGER PRIMARY KEY CHECK(id = 1), revision INTEGER NOT NULL, "
    "clock INTEGER NOT NULL);"
    "INSERT INTO facts VALUES(1, 0, 0);"
    "PRAGMA application_id = 1381257293;"
    "PRAGMA user_version = 1;"
    "COMMIT;";
static_assert(kApplicationId == 1381257293 && kSchemaVersion == 1);

class FileStorage final : public names::Storage {
 public:
  FileStorage(std::string path, std::string vfs) : path_(std::move(path)), vfs_(std::move(vfs)) {}

  expected<names::StoredContent, SetupError> load() override {
    names::StoredContent content;
    if (auto opened = open(content); !opened) return unexpected{std::move(opened.error())};
    if (content.faults.empty()) check_structure(content);
    if (database_.is_open()) {
      read_names(content);
      read_lapsed(content);
    }
    const auto revision =
        static_cast<std::uint64_t>(database_.integer_of("SELECT revision FROM facts", 0));
    content.first_revision = revision;
    for (const StoredName& each : content.names)
      content.first_revision = std::max({content.first_revision, each.revision, each.change});
    content.first_revision += kRevisionsPerStart;
    is_read_only_ = !content.faults.empty();
    if (is_read_only_) {
      // From now on nothing is written to it, not even on closing.
      static_cast<void>(database_.execute("PRAGMA query_only = 1"));
      static_cast<void>(
          sqlite3_db_config(database_.get(), SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, 1, nullptr));
      content.faults.push_back(
          "Nothing can be changed. To go on with what is sound, save it by "
          "`--dump`, move " +
          printable(path_) + " away, and give it back by `--load`.");
      return content;
    }
    if (!prepare()) return unexpected{unusable(database_.text(), kCheckPlace)};
    first_revision_ = content.first_revision;
    if (note_start() == SQLITE_DONE) return content;
    // Its names are valid, so they are served; each change tries again.
    const std::string why = database_.text();
    roll_back();
    content.faults.push_back("The database " + printable(path_) + " can't be written: " + why +
                             ". Its names are served, and nothing can be changed before it can be "
                             "written: free some space.");
    return content;
  }

  expected<std::uint64_t, StorageError> commit(const names::StoredChange& change) override {
    if (is_read_only_ || is_failed_) {
      const char* const why = is_read_only_ ? "it was found damaged" : "writing it failed before";
      return unexpected{
          StorageError{{"the database " + printable(path_) + " can't be changed", why}, kReadOnly}};
    }
    const int noted = note_start();
    if (const int result = noted == SQLITE_DONE ? write(change) : noted; result != SQLITE_DONE) {
      const std::string why = database_.text();
      roll_back();
      return unexpected{failure(result, why)};
    }
    // Changes written to a deleted file are lost when this program ends.
    if (database_.has_moved()) {
      return unexpected{
          StorageError{{"the database " + printable(path_) + " can't be changed",
                        "its file was deleted or replaced while the registry had it open",
                        "save the names that are still served (rtpm list), and start the registry "
                        "again with the file that is to be used"},
                       kReadOnly}};
    }
    return change.revision;
  }

 private:
  static constexpr auto kReadOnly = StorageError::Kind::kReadOnly;

  [[nodiscard]] SetupError unusable(const std::string& why, const std::string& remedy) const {
    return {"the database " + printable(path_) + " can't be used", why, remedy};
  }

  // Opens the database, and creates its tables if it is empty.
  expected<void, SetupError> open(names::StoredContent& content) {
    int result = database_.open(path_, vfs_);
    if (result == SQLITE_OK) {
      // Must come first: otherwise reading the data of a killed program would use shared memory.
      static_cast<void>(database_.execute("PRAGMA locking_mode = EXCLUSIVE"));
      // The structure check reads everything in random order, so use 64 MiB.
      static_cast<void>(database_.execute("PRAGMA cache_size = -65536"));
      // The journal of the switch to write-ahead logging must be gone from disk before the first
      // commit to the log: otherwise it would undo that commit after a power failure.
      set_durable(true);
      result = database_.execute("PRAGMA journal_mode = WAL");
    }
    if (result == SQLITE_OK) {
      // The first read takes the lock permanently.
      result = database_.execute("BEGIN IMMEDIATE; COMMIT");
    }
    const int primary = result & 0xff;
    if (primary == SQLITE_BUSY) {
      return unexpected{unusable("another program has it open", "end that one")};
    }
    if (primary == SQLITE_NOTADB || primary == SQLITE_CORRUPT) {
      content.faults.push_back("The database " + printable(path_) +
                               " is damaged: " + database_.text() + ".");
      return {};
    }
    if (result != SQLITE_OK) {
      return unexpected{unusable(database_.text(), kCheckPlace)};
    }
    return check_kind();
  }

  expected<void, SetupError> check_kind() {
    const std::int64_t kind = database_.integer_of("PRAGMA application_id", -1);
    const std::int64_t version = database_.integer_of("PRAGMA user_version", -1);
    const std::int64_t table_count = database_.integer_of("SELECT count(*) FROM sqlite_master", -1);
    if (kind == 0 && version == 0 && table_count == 0) {
      if (database_.execute(kCreate) == SQLITE_OK) return {};
      return unexpected{unusable(database_.text(), kCheckPlace)};
    }
    if (kind != kApplicationId) {
      return unexpected{unusable("it is another program's", "give --store another file")};
    }
    if (version > kSchemaVersion) {
      return unexpected{unusable("it is of a newer release, whose format " +
                                     std::to_string(version) + " this one does not know",
                                 "start that release")};
    }
    return {};
  }

  void check_structure(names::StoredContent& content) {
    Statement check = database_.prepare("PRAGMA integrity_check(3)");
    int result = check.step();
    for (; result == SQLITE_ROW; result = check.step()) {
      if (check.text(0) == "ok") return;
      content.faults.push_back("The database " + printable(path_) +
                               " is damaged: " + printable(check.text(0)) + ".");
    }
    if (content.faults.empty()) {
      content.faults.push_back("The database " + printable(path_) +
                               " is damaged: " + database_.text() + ".");
    }
  }

  // Reads all readable rows with a correct checksum. Leased names from before a reboot have
  // expired.
  void read_names(names::StoredContent& content) {
    const bool is_same_boot =
        clock() != 0 && database_.integer_of("SELECT clock FROM facts", 0) == clock();
    const std::string sql =
        "SELECT id, " + std::string(kColumns) + " FROM names WHERE id > ? ORDER BY id";
    Statement rows = database_.prepare(sql.c_str());
    std::int64_t last = -1;
    int damaged_count = 0;
    int skipped_count = 0;
    rows.bind(1, last);
    for (;;) {
      const int result = rows.step();
      if (result == SQLITE_DONE) break;
      if (result == SQLITE_ROW) {
        last = rows.integer(0);
        auto stored = read_row(rows, 1);
        if (!stored) {
          ++damaged_count;
        } else if (stored->is_permanent() || is_same_boot) {
          content.names.push_back(std::move(*stored));
        }
        continue;
      }
      // A damaged page: continue after its next row.
      if (++skipped_count > kSkippedRowMax) break;
      rows.reset();
      rows.bind(1, ++last);
    }
    if (damaged_count > 0) {
      content.faults.push_back(std::to_string(damaged_count) + " rows of " + printable(path_) +
                               " are damaged, and left out.");
    }
    if (skipped_count > 0) {
      content.faults.push_back("Some rows of " + printable(path_) +
                               " can't be read, and are left out: " + database_.text() + ".");
    }
  }

  void read_lapsed(names::StoredContent& content) {
    const std::string sql = "SELECT " + std::string(kColumns) + ", ended_ns FROM lapsed";
    Statement rows = database_.prepare(sql.c_str());
    if (!rows) return;  // The table does not exist yet.
    const MonotonicTime now = rt::now();
    const auto now_ns = static_cast<std::int64_t>(rt::utc_ns(now));
    int damaged_count = 0;
    while (rows.step() == SQLITE_ROW) {
      auto stored = read_row(rows, 0);
      if (!stored) {
        ++damaged_count;
        continue;
      }
      const Duration ago{std::max<std::int64_t>(now_ns - rows.integer(kColumnCount), 0)};
      content.lapsed.push_back({std::move(*stored), now - ago});
    }
    if (damaged_count > 0) {
      content.faults.push_back(std::to_string(damaged_count) + " rows of lost names in " +
                               printable(path_) + " are damaged, and left out.");
    }
  }

  // Rolls back a failed transaction, unless SQLite already has.
  void roll_back() {
    if (sqlite3_get_autocommit(database_.get()) == 0) {
      static_cast<void>(database_.execute("ROLLBACK"));
    }
  }

  // Prepares the statements of changes.
  bool prepare() {
    begin_ = database_.prepare("BEGIN IMMEDIATE");
    commit_ = database_.prepare("COMMIT");
    put_ = database_.prepare(
        "INSERT INTO names(name, url, interface, owner_id, owner_epoch, revision, change, host, "
        "lease_ns, properties, checksum) VALUES(?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?) "
        "ON CONFLICT(name) DO UPDATE SET url = excluded.url, interface = excluded.interface, "
        "owner_id = excluded.owner_id, owner_epoch = excluded.owner_epoch, "
        "revision = excluded.revision, change = excluded.change, host = excluded.host, "
        "lease_ns = excluded.lease_ns, properties = excluded.properties, "
        "checksum = excluded.checksum");
    erase_ = database_.prepare("DELETE FROM names WHERE name = ?");
    advance_ = database_.prepare("UPDATE facts SET revision = ?");
    return begin_ && commit_ && put_ && erase_ && advance_;
  }

  // Records this start before its first change, once. Returns SQLITE_DONE or an error.
  int note_start() {
    if (is_start_noted_) return SQLITE_DONE;
    const bool is_same_boot = database_.integer_of("SELECT clock FROM facts", 0) == clock();
    const std::string note = "BEGIN IMMEDIATE; " + std::string(kCreateLapsed) +
                             "UPDATE facts SET revision = " + std::to_string(first_revision_) +
                             ", clock = " + std::to_string(clock()) +
                             (is_same_boot ? "" : "; DELETE FROM names WHERE lease_ns > 0") +
                             "; COMMIT";
    const int result = database_.execute(note.c_str());
    if (result != SQLITE_OK) return result;
    const std::string columns = kColumns;
    const std::string lapse = "INSERT OR REPLACE INTO lapsed(" + columns + ", ended_ns) SELECT " +
                              columns + ", ? FROM names WHERE name = ?";
    lapse_ = database_.prepare(lapse.c_str());
    dismiss_ = database_.prepare("DELETE FROM lapsed WHERE name = ?");
    is_start_noted_ = lapse_ && dismiss_;
    return is_start_noted_ ? SQLITE_DONE : SQLITE_ERROR;
  }

  /// Returns SQLITE_DONE or an error.
  int write(const names::StoredChange& change) {
    set_durable(change.is_durable);
    if (const int begun = begin_.run(); begun != SQLITE_DONE) return begun;
    if (const int kept = write_lapse(change); kept != SQLITE_DONE) return kept;
    int result = SQLITE_DONE;
    if (change.stored != nullptr) {
      const std::string properties = encode(change.stored->properties);
      bind_row(put_, *change.stored, properties);
      result = put_.run();
    } else {
      erase_.bind(1, change.name);
      result = erase_.run();
    }
    if (result != SQLITE_DONE) return result;
    advance_.bind(1, static_cast<std::int64_t>(change.revision));
    if (const int advanced = advance_.run(); advanced != SQLITE_DONE) return advanced;
    return commit_.run();
  }

  // Stores a name whose lease ended, before it is removed; any other change removes the stored
  // lapse.
  int write_lapse(const names::StoredChange& change) {
    if (!change.lapsed) {
      dismiss_.bind(1, change.name);
      return dismiss_.run();
    }
    lapse_.bind(1, static_cast<std::int64_t>(rt::utc_ns(*change.lapsed)));
    lapse_.bind(2, change.name);
    return lapse_.run();
  }

  // Sets whether commits wait for the disk.
  void set_durable(bool is_durable) {
    if (is_durable_ == is_durable) return;
    static_cast<void>(database_.execute(is_durable ? "PRAGMA synchronous = EXTRA"
                                                   : "PRAGMA synchronous = NORMAL"));
    is_durable_ = is_durable;
  }

  [[nodiscard]] StorageError failure(int result, const std::string& why) {
    const int primary = result & 0xff;
    const std::string what = "the database " + printable(path_) + " was not written";
    if (primary == SQLITE_FULL) {
      return {{what, why, "free some space"}, StorageError::Kind::kFull};
    }
    // After a failed write the disk's content is unknown: the next start checks it.
    if (primary == SQLITE_IOERR || primary == SQLITE_CORRUPT) is_failed_ = true;
    return {{what, why, "check the disk, and start again"}, StorageError::Kind::kFailed};
  }

  [[nodiscard]] static std::int64_t clock() noexcept {
    return static_cast<std::int64_t>(rt::clock_domain());
  }

  std::string path_;
  std::string vfs_;
  Database database_{};
  Statement begin_{};
  Statement commit_{};
  Statement put_{};
  Statement erase_{};
  Statement advance_{};
  Statement lapse_{};
  Statement dismiss_{};
  std::uint64_t first_revision_ = 0;
  bool is_start_noted_ = false;
  bool is_durable_ = false;
  bool is_read_only_ = false;
  bool is_failed_ = false;
};

}  // namespace

std::unique_ptr<names::Storage> make_file_storage(std::string path, std::string vfs) {
  return std::make_unique<FileStorage>(std::move(path), std::move(vfs));
}

}  // namespace rtpm::file_store
