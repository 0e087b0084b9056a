#include "rtpm/file_store/file_storage.hpp"

#include <gtest/gtest.h>
#include <sqlite3.h>

#include <chrono>
#include <string>

#include "folder.hpp"

namespace rtpm::file_store {
namespace {

using namespace std::chrono_literals;
using names::StoredName;

names::StoredContent loaded(names::Storage& storage) {
  auto content = storage.load();
  EXPECT_TRUE(content) << content.error().text();
  return content ? std::move(*content) : names::StoredContent{};
}

void execute(const std::string& path, const char* sql) {
  sqlite3* database = nullptr;
  ASSERT_EQ(sqlite3_open(path.c_str(), &database), SQLITE_OK);
  EXPECT_EQ(sqlite3_exec(database, sql, nullptr, nullptr, nullptr), SQLITE_OK)
      << sqlite3_errmsg(database);
  sqlite3_close(database);
}

TEST(FileStorage, RestoresStoredNames) {
  const Folder folder;
  StoredName leased = permanent("lab/arm1", 12);
  leased.lease = 2s;
  leased.properties.clear();
  std::uint64_t first_revision = 0;
  {
    const auto storage = make_file_storage(folder.file());
    first_revision = loaded(*storage).first_revision;
    ASSERT_TRUE(put(*storage, permanent("lab/arm0", 10)));
    ASSERT_TRUE(put(*storage, permanent("lab/arm2", 11)));
    ASSERT_TRUE(put(*storage, leased));
    ASSERT_TRUE(put(*storage, permanent("lab/arm0", 13)));  // Replaces the entry.
    ASSERT_TRUE(storage->commit({"lab/arm2", nullptr, 14, true}));
  }
  const auto storage = make_file_storage(folder.file());
  const auto content = loaded(*storage);
  EXPECT_TRUE(content.faults.empty());
  ASSERT_EQ(content.names.size(), 2u);
  EXPECT_EQ(content.names[0], permanent("lab/arm0", 13));
  EXPECT_EQ(content.names[1], leased) << "it outlasts the program";
  EXPECT_GT(content.first_revision, 14u);
  EXPECT_GT(content.first_revision, first_revision);
}

TEST(FileStorage, NeverReusesARevision) {
  const Folder folder;
  std::uint64_t former = 0;
  for (int start = 0; start < 3; ++start) {
    const auto storage = make_file_storage(folder.file());
    const auto content = loaded(*storage);
    EXPECT_GT(content.first_revision, former);
    former = content.first_revision + 5;
    ASSERT_TRUE(storage->commit({"lab/arm0", nullptr, former, false}));
  }
}

TEST(FileStorage, DropsLeasedNamesOfAnEarlierBoot) {
  const Folder folder;
  StoredName leased = permanent("lab/arm1", 2);
  leased.lease = 2s;
  {
    const auto storage = make_file_storage(folder.file());
    static_cast<void>(loaded(*storage));
    ASSERT_TRUE(put(*storage, permanent("lab/arm0", 1)));
    ASSERT_TRUE(put(*storage, leased));
  }
  execute(folder.file(), "UPDATE facts SET clock = clock + 1");
  for (int start = 0; start < 2; ++start) {
    const auto storage = make_file_storage(folder.file());
    const auto content = loaded(*storage);
    ASSERT_EQ(content.names.size(), 1u);
    EXPECT_EQ(content.names[0].name, "lab/arm0");
  }
}

TEST(FileStorage, RefusesForeignAndHeldDatabases) {
  const Folder folder;
  const auto refusal_of = [](const std::string& path) {
    const auto content = make_file_storage(path)->load();
    EXPECT_FALSE(content);
    return content ? std::string() : content.error().text();
  };
  execute(folder.file("other.db"), "CREATE TABLE birds(name TEXT)");
  test::expect_text(refusal_of(folder.file("other.db")), {"another program's"});
  static_cast<void>(loaded(*make_file_storage(folder.file("newer.db"))));
  execute(folder.file("newer.db"), "PRAGMA user_version = 2");
  test::expect_text(refusal_of(folder.file("newer.db")), {"newer release"});
  test::expect_text(refusal_of("/nowhere/at/all/names.db"), {"check its folder"});
  const auto holder = make_file_storage(folder.file("held.db"));
  static_cast<void>(loaded(*holder));
  test::expect_text(refusal_of(folder.file("held.db")), {"another program has it open"});
}

}  // namespace
}  // namespace rtpm::file_store
