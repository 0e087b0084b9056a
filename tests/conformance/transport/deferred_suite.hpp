#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/memory.hpp"
#include "suite.hpp"

/// The common part of the tests of deferred replies and of streams.
namespace rtpm::rpc::test {

inline constexpr MethodDescriptor kLater{1, "later", 201, false, {}};
inline constexpr MethodDescriptor kCount{2, "count", 202, false, {}};
inline constexpr MethodDescriptor kNote{3, "note", 203, false, {}};
inline constexpr std::array kDeferredMethods{kLater, kCount, kNote};
inline constexpr InterfaceDescriptor kDeferredInterface{"test.Late", 4712, "by hand",
                                                        kDeferredMethods};

/// Answers when the test asks for it.
class DeferringServant final : public Servant {
 public:
  const InterfaceDescriptor& interface() const noexcept override { return kDeferredInterface; }

  DispatchResult dispatch(std::uint16_t method_id, ConstBytes request, MutableBytes,
                          const CallContext& context) override {
    const std::lock_guard lock(mutex_);
    const rt::AllowAllocationScope is_allowed;
    if (method_id == kNote.id) {
      notes_.emplace_back(reinterpret_cast<const char*>(request.data()), request.size());
      return {};
    }
    if (method_id == kLater.id) {
      DeferredReply reply = context.deferral->defer();
      if (!reply) return {wire::Status::kOverload, 0};
      replies_.push_back(std::move(reply));
      return {};
    }
    ItemWriter writer = context.deferral->stream();
    if (!writer) return {wire::Status::kOverload, 0};
    writers_.push_back(std::move(writer));
    return {};
  }

  /// The oldest call that was deferred, once there is one.
  [[nodiscard]] DeferredReply reply() { return take(replies_); }
  [[nodiscard]] ItemWriter writer() { return take(writers_); }
  [[nodiscard]] std::vector<std::string> notes() {
    const std::lock_guard lock(mutex_);
    return notes_;
  }

 private:
  template <class T>
  T take(std::deque<T>& from) {
    T first;
    EXPECT_TRUE(await([&] {
      const std::lock_guard lock(mutex_);
      if (from.empty()) return false;
      first = std::move(from.front());
      from.pop_front();
      return true;
    }));
    return first;
  }

  std::mutex mutex_;
  std::deque<DeferredReply> replies_;
  std::deque<ItemWriter> writers_;
  std::vector<std::string> notes_;
};

class DeferredReplies : public TransportSuite {
 protected:
  explicit DeferredReplies(ServerConfig config = quiet_config()) {
    // The configuration was made before the suite's set-up.
    if (is_sealed(transport())) config.security = sealed_files().of_server();
    auto created = Server::create(std::move(config));
    EXPECT_TRUE(created) << created.error().text();
    server_ = std::move(*created);
    EXPECT_TRUE(server_->add("late", servant_));
    EXPECT_TRUE(server_->start());
    auto bound = Binding::bind(node_, server_->url("late"), kDeferredInterface,
                               {.deadline = rtpm::test::kPatience});
    EXPECT_TRUE(bound) << bound.error().text();
    binding_.emplace(std::move(*bound));
  }

  [[nodiscard]] static MonotonicTime soon() { return rt::now() + rtpm::test::kPatience; }
  static void answer(DeferredReply reply, std::string_view text) {
    ASSERT_TRUE(reply);
    const MutableBytes room = reply.buffer();
    ASSERT_GE(room.size(), text.size());
    std::ranges::copy(bytes_of(text), room.begin());
    reply.complete(wire::Status::kOk, static_cast<std::uint32_t>(text.size()));
  }
  static void write(ItemWriter& writer, std::string_view text) {
    expected<void, StreamError> written;
    // Items that the caller has not taken yet fill the window for a while.
    EXPECT_TRUE(await([&] {
      written = writer.write(bytes_of(text));
      return written || written.error() != StreamError::kFull;
    }));
    EXPECT_TRUE(written);
  }
  [[nodiscard]] static std::string text_of_next(ItemReader& reader) {
    const auto item = reader.next(soon());
    if (!item) return std::string(to_string(item.error()));
    if (!*item) return "(end)";
    return {reinterpret_cast<const char*>((*item)->data()), (*item)->size()};
  }

  DeferringServant servant_;
  std::unique_ptr<Server> server_;
  Node node_{node_config()};
  std::optional<Binding> binding_;
};

/// An item whose every byte follows from its number.
[[nodiscard]] inline std::vector<std::byte> item_of(std::uint32_t number, std::size_t size) {
  std::vector<std::byte> item(size);
  for (std::size_t i = 0; i < size; ++i)
    item[i] = static_cast<std::byte>(number * 31 + i * 7 + (i >> 8));
  return item;
}

}  // namespace rtpm::rpc::test
