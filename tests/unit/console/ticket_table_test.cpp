#include "downloads/ticket_table.hpp"

#include <gtest/gtest.h>

#include "../recording/recorded.hpp"

namespace rtpm::console {
namespace {

class Tickets : public testing::Test {
 protected:
  std::string add(std::uint64_t connection_id, const std::string& name = "run.csv") {
    auto ticket = tickets_.add(connection_id, {.path = name, .name = name}, now_);
    EXPECT_TRUE(ticket) << ticket.error().text();
    return ticket ? *ticket : "";
  }

  TicketTable tickets_{};
  MonotonicTime now_{std::chrono::hours{1}};
};

TEST_F(Tickets, AreGoodOnce) {
  const std::string a = add(1, "a.csv");
  const std::string b = add(1, "b.csv");
  EXPECT_GE(a.size(), 32u) << "192 bits";
  EXPECT_NE(a, b);
  EXPECT_FALSE(tickets_.take(a.substr(1), now_));
  EXPECT_FALSE(tickets_.take("", now_));
  const auto download = tickets_.take(a, now_);
  ASSERT_TRUE(download);
  EXPECT_EQ(download->name, "a.csv");
  EXPECT_FALSE(tickets_.take(a, now_));
  EXPECT_TRUE(tickets_.take(b, now_));
}

TEST_F(Tickets, AreGoodForAMinute) {
  const std::string ticket = add(1);
  EXPECT_TRUE(tickets_.take(add(1), now_ + std::chrono::seconds{59}));
  EXPECT_FALSE(tickets_.take(ticket, now_ + std::chrono::seconds{60}));
  EXPECT_EQ(tickets_.size(), 0u);
}

TEST_F(Tickets, EndWithTheirConnection) {
  const std::string mine = add(1);
  const std::string other = add(2);
  tickets_.drop(1);
  EXPECT_FALSE(tickets_.take(mine, now_));
  EXPECT_TRUE(tickets_.take(other, now_));
}

TEST_F(Tickets, HaveALimit) {
  for (std::size_t i = 0; i < TicketTable::kCountMax; ++i)
    add(i);
  EXPECT_FALSE(tickets_.add(99, {}, now_));
  now_ += std::chrono::minutes{1};
  EXPECT_TRUE(tickets_.add(99, {}, now_)) << "old ones make room";
}

TEST_F(Tickets, RemoveTheirFilesWhenNobodyFetchesThem) {
  recording::Folder folder;
  const std::string path = folder.fresh("made");
  std::filesystem::create_directory(path);
  static_cast<void>(tickets_.add(
      1, {.path = path, .name = "x", .made = std::make_shared<MadeFolder>(path)}, now_));
  EXPECT_TRUE(std::filesystem::exists(path));
  tickets_.expire(now_ + std::chrono::minutes{2});
  EXPECT_FALSE(std::filesystem::exists(path));
}

}  // namespace
}  // namespace rtpm::console
