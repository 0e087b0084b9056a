#include "live/device_state.hpp"

#include <gtest/gtest.h>

#include "rtpm/rt/clock.hpp"

// The state of a device, as a browser gets it.
namespace rtpm::console {
namespace {

using std::chrono::seconds;

/// A console that was opened beside a running system has seen no event of a lease.
class LeaseBeforeItsFirstEvent : public testing::Test {
 protected:
  void take(std::optional<HolderView> holder) {
    state_.take({.name = "lab/arm0", .holder = std::move(holder)}, now_);
  }
  [[nodiscard]] nlohmann::ordered_json lease() const {
    return state_.json(now_ + seconds{1}, false, std::nullopt)["lease"];
  }

  MonotonicTime now_ = rt::now();
  DeviceState state_{"lab/arm0"};
};

TEST_F(LeaseBeforeItsFirstEvent, IsFreeIfTheServerKnowsNoHolder) {
  take(HolderView{.is_held = false});
  EXPECT_EQ(lease()["state"], "free");
  EXPECT_EQ(lease()["holder"], "");
  EXPECT_TRUE(lease()["since_s"].is_null());
}

TEST_F(LeaseBeforeItsFirstEvent, HasTheHolderThatTheServerNames) {
  take(HolderView{.is_held = true, .name = "rtpm-servo on lab2", .held_for = seconds{5}});
  EXPECT_EQ(lease()["state"], "held");
  EXPECT_EQ(lease()["holder"], "rtpm-servo on lab2");
  EXPECT_EQ(lease()["since_s"], 6.0);
  take(std::nullopt);
  EXPECT_EQ(lease()["holder"], "rtpm-servo on lab2") << "not every read asks for the holder";
  take(HolderView{.is_held = true});
  EXPECT_EQ(lease()["state"], "held") << "a holder without a name";
  EXPECT_TRUE(lease()["since_s"].is_null());
}

TEST_F(LeaseBeforeItsFirstEvent, IsUnknownOfAnOlderServer) {
  take(std::nullopt);
  EXPECT_EQ(lease()["state"], "unknown");
}

TEST_F(LeaseBeforeItsFirstEvent, ThenFollowsEventsWhichComeSooner) {
  take(HolderView{.is_held = true, .name = "rtpm-servo on lab2", .held_for = seconds{5}});
  state_.take_lease(gvd::LeaseState::kReleased, now_);
  EXPECT_EQ(lease()["state"], "free");
  EXPECT_EQ(lease()["holder"], "");
  EXPECT_EQ(lease()["since_s"], 1.0);
}

}  // namespace
}  // namespace rtpm::console
