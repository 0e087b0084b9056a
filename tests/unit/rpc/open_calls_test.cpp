#include "calls/open_calls.hpp"

#include <gtest/gtest.h>

#include <array>
#include <functional>
#include <memory>

#include "../wire/peers.hpp"
#include "execution/thread_pool.hpp"
#include "model/lane_setup.hpp"
#include "one_port.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/transport/tcp.hpp"
#include "rtpm/transport/wait_set.hpp"

// Answering calls that have ended while other threads may hold the lane's lock.
namespace rtpm::rpc {
namespace {

using namespace wire::test;

constexpr std::uint32_t kMessageSize = 16 * 1024;

/// The lock, and other threads' actions while it is free.
class ScriptedLock final : public transport::WaitLock {
 public:
  void lock() noexcept override {}
  void unlock() noexcept override {
    ++unlock_count;
    if (on_unlocked) on_unlocked();
  }
  int unlock_count = 0;
  std::function<void()> on_unlocked;
};

class OpenCallsTest : public testing::Test {
 protected:
  OpenCallsTest() {
    calls_.share(&lock_);
    EXPECT_EQ(peer_.open(media_.datagrams(), rt::now()).kind, wire::FrameKind::kWelcome);
  }
  ~OpenCallsTest() override { threads_.unlock(); }

  LaneSetup setup() {
    config_.lanes.resize(1);
    config_.message_size_max = kMessageSize;
    config_.large_message_count_max = 2;
    LaneSetup setup;
    setup.server = &config_;
    setup.epoch = 1;
    setup.acceptor_bell = wait_set_.get();
    setup.slot = &slot_;
    return setup;
  }
  /// A call that its method has ended with a reply of `size` bytes.
  PendingCall& ended_call(std::uint32_t call_id, std::uint32_t size) {
    const wire::Verdict verdict =
        media_.datagrams().on_frame(peer_.call_frame(call_id), peer_.address, rt::now());
    EXPECT_EQ(verdict.action, wire::Verdict::Action::kDispatch);
    PendingCall& call = *pool_->keep(media_.datagrams(), verdict.request);
    std::ranges::fill(call.reply.first(size), std::byte{7});
    call.size = size;
    call.is_ended = true;
    return call;
  }
  [[nodiscard]] std::uint32_t held_count() {
    return media_.datagrams().large_message_count(rt::now());
  }

  ServerConfig config_;
  LaneSlot slot_;
  std::unique_ptr<transport::WaitSet> wait_set_ = std::move(*transport::WaitSet::open(8));
  LaneReport report_{slot_, LaneConfig{}, Band{}};
  Media media_{setup(), test::one_port(transport::TcpListener::open("127.0.0.1", 0)->port()),
               *wait_set_, report_};
  std::shared_ptr<Doorbell> doorbell_ = std::make_shared<Doorbell>(*wait_set_);
  std::shared_ptr<PendingPool> pool_ =
      std::make_shared<PendingPool>(8, 8, kMessageSize, 0, /*keeps_requests=*/true, doorbell_);
  LaneTap tap_{/*has_pool=*/false};
  OpenCalls calls_{pool_, 8, media_, report_, *doorbell_, tap_};
  ScriptedLock lock_;
  ThreadPool threads_{LaneConfig{}, 8, *wait_set_};
  Lead& lead_ = threads_.lock_as_follower();
  Peer peer_;
};

TEST_F(OpenCallsTest, CopyALargeReplyWithoutTheLock) {
  calls_.serve(lead_, ended_call(1, 100));
  EXPECT_EQ(lock_.unlock_count, 0) << "a small one takes no longer than the lock";
  PendingCall& call = ended_call(2, kMessageSize);
  lock_.on_unlocked = [&] {
    EXPECT_EQ(held_count(), 1) << "its buffer";
    calls_.serve(lead_, call);
    EXPECT_TRUE(call.is_taken) << "it is served once";
  };
  calls_.serve(lead_, call);
  EXPECT_EQ(lock_.unlock_count, 1);
  EXPECT_FALSE(pool_->has_ready() || calls_.has_any());
  const wire::Verdict again =
      media_.datagrams().on_frame(peer_.call_frame(2), peer_.address, rt::now());
  ASSERT_EQ(again.action, wire::Verdict::Action::kSend);
  EXPECT_EQ(header_of(again.frame).message_size, kMessageSize);
  EXPECT_EQ(again.frame.back(), std::byte{7});
  EXPECT_EQ(held_count(), 1) << "until the reply has arrived";
}

TEST_F(OpenCallsTest, ReleaseTheBufferIfTheSessionEndsMeanwhile) {
  for (std::uint32_t call_id = 1; call_id <= 5; ++call_id) {
    PendingCall& call = ended_call(call_id, kMessageSize);
    lock_.on_unlocked = [&] {
      wire::Header close;
      close.kind = wire::FrameKind::kClose;
      close.session = peer_.session;
      static_cast<void>(media_.datagrams().on_frame(frame_of(close), peer_.address, rt::now()));
      EXPECT_EQ(media_.datagrams().session_count(), 0);
    };
    calls_.serve(lead_, call);
    EXPECT_EQ(lock_.unlock_count, static_cast<int>(call_id));
    EXPECT_EQ(held_count(), 0);
    EXPECT_FALSE(calls_.has_any());
    ++peer_.handshake_number;
    ++peer_.channel;
    EXPECT_EQ(peer_.open(media_.datagrams(), rt::now()).kind, wire::FrameKind::kWelcome);
  }
}

// The handle of an unfinished call may outlive the lane, and its wait set.
TEST(ADoorbell, MayRingAfterItsLaneHasEnded) {
  auto wait_set = std::move(*transport::WaitSet::open(1));
  Doorbell doorbell(*wait_set);
  doorbell.announce_sleep();
  doorbell.wake();
  std::array<transport::SourceTag, 1> ready{};
  EXPECT_EQ(wait_set->wait(transport::kAlready, ready), 1);
  doorbell.close();
  wait_set.reset();
  doorbell.wake();
}

}  // namespace
}  // namespace rtpm::rpc
