#include "runs/contender.hpp"

#include <utility>
#include <vector>

namespace rtpm::bench {
namespace {

class DuelContender final : public Contender {
 public:
  DuelContender(Duel& duel, Side side) : duel_(duel), side_(side) {}

  [[nodiscard]] expected<void, std::string> connect(const DuelConfig& config, Duration work) {
    duel_.take_turn(side_);
    auto high = duel_.connect_high();
    if (!high) return unexpected{high.error()};
    high_ = std::move(*high);
    std::vector<Job> jobs;
    for (int i = 0; i < config.low_caller_count; ++i) {
      auto caller = duel_.connect_low();
      if (!caller) return unexpected{caller.error()};
      // Shared, because a job is copied.
      jobs.emplace_back(
          [held = std::shared_ptr<Caller>(std::move(*caller)), work] { return held->work(work); });
    }
    if (!jobs.empty()) {
      load_ = std::make_unique<LowLoad>(config.placement, config.realtime, std::move(jobs));
    }
    duel_.end_turn();
    return {};
  }

  expected<void, std::string> take_turn(const TurnPlan& plan, Samples& high,
                                        Samples& low) override {
    duel_.take_turn(side_);
    auto taken = run_turn(plan, *high_, load_.get(), high, low);
    duel_.end_turn();
    return taken;
  }

 private:
  Duel& duel_;
  Side side_;
  std::unique_ptr<Caller> high_{};
  std::unique_ptr<LowLoad> load_{};
};

}  // namespace

expected<std::unique_ptr<Contender>, std::string> connect_contender(Duel& duel, Side side,
                                                                    const DuelConfig& config,
                                                                    Duration work) {
  auto contender = std::make_unique<DuelContender>(duel, side);
  if (auto connected = contender->connect(config, work); !connected) {
    return unexpected{connected.error()};
  }
  return std::unique_ptr<Contender>(std::move(contender));
}

}  // namespace rtpm::bench
