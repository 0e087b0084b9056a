#include "rtpm/rpc/tables.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "rtpm/test/echo_server.hpp"

namespace rtpm::rpc {
namespace {

using namespace test;

/// table Note { weight: double; text: string; }, in flatc's layout.
struct Note : private flatbuffers::Table {
  static constexpr flatbuffers::voffset_t kWeight = 4;
  static constexpr flatbuffers::voffset_t kText = 6;

  [[nodiscard]] double weight() const { return GetField<double>(kWeight, 0); }
  [[nodiscard]] const double* weight_address() const {
    return reinterpret_cast<const double*>(GetAddressOf(kWeight));
  }
  [[nodiscard]] std::string text() const {
    return GetPointer<const flatbuffers::String*>(kText)->str();
  }
  bool Verify(flatbuffers::Verifier& verifier) const {
    return VerifyTableStart(verifier) && VerifyField<double>(verifier, kWeight, alignof(double)) &&
           VerifyOffsetRequired(verifier, kText) &&
           verifier.VerifyString(GetPointer<const flatbuffers::String*>(kText)) &&
           verifier.EndTable();
  }
};

flatbuffers::Offset<Note> create_note(flatbuffers::FlatBufferBuilder& builder,
                                      const std::string& text, double weight) {
  const auto text_offset = builder.CreateString(text);
  const auto start = builder.StartTable();
  builder.AddElement<double>(Note::kWeight, weight, 0);
  builder.AddOffset(Note::kText, text_offset);
  return flatbuffers::Offset<Note>(builder.EndTable(start));
}

/// A lane's reply buffer with guard bytes behind it.
class ReplyMemory {
 public:
  explicit ReplyMemory(std::size_t size) : size_(size) {
    std::ranges::fill(bytes_, std::byte{0xfe});
  }
  [[nodiscard]] MutableBytes bytes() { return MutableBytes(bytes_).first(size_); }
  [[nodiscard]] bool is_fence_whole() const {
    return std::all_of(bytes_.begin() + static_cast<std::ptrdiff_t>(size_), bytes_.end(),
                       [](std::byte byte) { return byte == std::byte{0xfe}; });
  }

 private:
  std::size_t size_;
  alignas(64) std::array<std::byte, 4096> bytes_{};
};

TEST(ReplyBuilder, BuildsInTheGivenMemory) {
  ReplyMemory memory(1344);
  ReplyBuilder<Note> reply(memory.bytes());
  reply.finish(create_note(reply.builder(), "in place", 2.5));
  const auto* at = reinterpret_cast<const std::byte*>(reply.builder().GetBufferPointer());
  EXPECT_TRUE(at >= memory.bytes().data() && at < memory.bytes().data() + memory.bytes().size());
  const DispatchResult result = reply.complete();
  EXPECT_EQ(result.status, wire::Status::kOk);
  const ConstBytes bytes = memory.bytes().first(result.reply_size);
  ASSERT_TRUE(is_valid_table<Note>(bytes));
  const auto* note = flatbuffers::GetRoot<Note>(bytes.data());
  EXPECT_EQ(note->text(), "in place");
  EXPECT_EQ(note->weight(), 2.5);
  EXPECT_EQ(reinterpret_cast<std::uintptr_t>(note->weight_address()) % 8, 0u);
}

// A reply that fits is complete, a larger one is refused, and no buffer overruns, for any size.
TEST(ReplyBuilder, ReportsAReplyThatIsTooLarge) {
  for (const std::size_t buffer : {1024u, 1031u, 1344u}) {
    bool was_too_large = false;
    for (std::size_t size = 0; size < 1400; size += 7) {
      ReplyMemory memory(buffer);
      ReplyBuilder<Note> reply(memory.bytes());
      const std::string text(size, 'x');
      reply.finish(create_note(reply.builder(), text, 1));
      const DispatchResult result = reply.complete();
      ASSERT_TRUE(memory.is_fence_whole()) << size;
      if (result.status == wire::Status::kTooLarge) {
        EXPECT_EQ(result.reply_size, 0u);
        EXPECT_GT(size + 64, buffer) << "it would have fitted";
        was_too_large = true;
        continue;
      }
      ASSERT_FALSE(was_too_large) << "a larger one fits after a smaller one did not";
      ASSERT_EQ(result.status, wire::Status::kOk);
      const ConstBytes bytes = memory.bytes().first(result.reply_size);
      ASSERT_TRUE(is_valid_table<Note>(bytes));
      EXPECT_EQ(flatbuffers::GetRoot<Note>(bytes.data())->text(), text);
    }
    EXPECT_TRUE(was_too_large);
  }
}

TEST(ReplyBuilder, ReportsAnUnfinishedReply) {
  ReplyMemory memory(1024);
  ReplyBuilder<Note> reply(memory.bytes());
  static_cast<void>(create_note(reply.builder(), "unfinished", 1));
  EXPECT_EQ(reply.complete().status, wire::Status::kServantFailed);
}

Bytes encoded_note(const std::string& text) {
  flatbuffers::FlatBufferBuilder builder;
  builder.Finish(create_note(builder, text, 1));
  const ConstBytes bytes = table_bytes(builder);
  return {bytes.begin(), bytes.end()};
}

TEST(ValidTable, RejectsTruncatedAndChangedBytes) {
  const Bytes good = encoded_note("a note of some length");
  ASSERT_TRUE(is_valid_table<Note>(good));
  for (std::size_t size = 0; size < good.size() - 4; ++size) {
    const Bytes cut(good.begin(), good.begin() + static_cast<std::ptrdiff_t>(size));
    EXPECT_FALSE(is_valid_table<Note>(cut)) << size;
  }
  std::mt19937_64 random(1);
  for (int round = 0; round < 20'000; ++round) {
    Bytes bytes = good;
    for (int i = 0; i < 3; ++i)
      bytes[random() % bytes.size()] = static_cast<std::byte>(random());
    // Bytes that pass verification are safe to read.
    if (is_valid_table<Note>(bytes)) {
      EXPECT_LE(flatbuffers::GetRoot<Note>(bytes.data())->text().size(), bytes.size());
    }
  }
}

// hp-12-5
TEST(ValidTable, HasNoSizePrefixAndNeedsNoIdentifier) {
  const Bytes plain = encoded_note("plain");
  EXPECT_TRUE(is_valid_table<Note>(plain));
  flatbuffers::FlatBufferBuilder named;
  named.Finish(create_note(named, "named", 1), "RTPM");
  EXPECT_TRUE(is_valid_table<Note>(table_bytes(named)));
  Bytes prefixed(4, std::byte{0});
  prefixed[0] = static_cast<std::byte>(plain.size());
  prefixed.insert(prefixed.end(), plain.begin(), plain.end());
  EXPECT_FALSE(is_valid_table<Note>(prefixed));
}

class TableCalls : public testing::Test {
 protected:
  EchoServer server_;
  Node node_{quiet_node()};
  Binding binding_ = bind_echo(node_, server_);
};

TEST_F(TableCalls, ReturnATable) {
  auto reply = call_for_table<Note>(binding_, echo::kEcho, encoded_note("hello"), {});
  ASSERT_TRUE(reply);
  EXPECT_EQ((*reply)->text(), "hello");
  EXPECT_EQ((**reply).weight(), 1);
}

TEST_F(TableCalls, RejectAReplyOfAnotherType) {
  const std::array<std::byte, 24> bytes{};
  EXPECT_EQ(call_for_table<Note>(binding_, echo::kEcho, bytes, {}).error(), CallError::kBadReply);
  EXPECT_EQ(call_for_table<Note>(binding_, echo::kEcho, {}, {}).error(), CallError::kBadReply);
  EXPECT_EQ(call_for_nothing(binding_, echo::kEcho, bytes, {}).error(), CallError::kBadReply);
  EXPECT_EQ((call_for_struct<std::array<std::byte, 23>>(binding_, echo::kEcho, bytes, {}).error()),
            CallError::kBadReply);
  EXPECT_EQ((call_for_struct<std::array<std::byte, 25>>(binding_, echo::kEcho, bytes, {}).error()),
            CallError::kBadReply);
  EXPECT_TRUE((call_for_struct<std::array<std::byte, 24>>(binding_, echo::kEcho, bytes, {})));
  EXPECT_TRUE(call_for_nothing(binding_, echo::kEcho, {}, {}));
}

TEST_F(TableCalls, ReturnTheErrorsOfTheCall) {
  const MethodDescriptor unknown{77, "unknown", 1, false, {}};
  EXPECT_EQ(call_for_table<Note>(binding_, unknown, {}, {}).error(), CallError::kNoSuchMethod);
  EXPECT_EQ(call_for_struct<double>(binding_, unknown, {}, {}).error(), CallError::kNoSuchMethod);
  EXPECT_EQ(call_for_nothing(binding_, unknown, {}, {}).error(), CallError::kNoSuchMethod);
}

TEST(ServantResults, BecomeReplies) {
  std::array<std::byte, 64> buffer{};
  const Result<double> number = 2.5;
  const DispatchResult given = reply_with_struct(number, buffer);
  EXPECT_EQ(given.status, wire::Status::kOk);
  EXPECT_EQ(given.reply_size, sizeof(double));
  EXPECT_EQ(reply_with_struct(number, MutableBytes(buffer).first(7)).status,
            wire::Status::kTooLarge);
  const Result<double> refused = unexpected{Refusal::kNotLeaseHolder};
  EXPECT_EQ(reply_with_struct(refused, buffer).status, wire::Status::kNotLeaseHolder);
  EXPECT_EQ(reply_with_nothing({}).status, wire::Status::kOk);
  EXPECT_EQ(reply_with_nothing(unexpected{Refusal::kOverload}).status, wire::Status::kOverload);
}

}  // namespace
}  // namespace rtpm::rpc
