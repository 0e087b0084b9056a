#include "rtpm/device_evdev/effects.hpp"

#include <array>
#include <cerrno>
#include <system_error>

#include "rtpm/device_evdev/transport.hpp"

namespace rtpm::device_evdev {
namespace {

constexpr std::array kNamesOfKinds{"a constant force", "a rumble", "a spring", "a damper"};

constexpr int kStopAttemptMax = 3;

/// Sets the level of `effect`. Returns whether the level is greater than zero.
bool set_level(Effect& effect, const Levels& levels) noexcept {
  switch (effect.kind) {
    case EffectKind::kConstant:
      effect.level = levels.effort;
      return levels.effort != 0;
    case EffectKind::kRumble:
      effect.strong = levels.strong;
      effect.weak = levels.weak;
      return levels.strong != 0 || levels.weak != 0;
    case EffectKind::kSpring:
      effect.coefficient = levels.spring;
      return levels.spring != 0;
    case EffectKind::kDamper:
      effect.coefficient = levels.damper;
      return levels.damper != 0;
  }
  return false;
}

bool is_same_level(const Effect& a, const Effect& b) noexcept {
  return a.level == b.level && a.strong == b.strong && a.weak == b.weak &&
         a.coefficient == b.coefficient;
}

}  // namespace

EffectBank::EffectBank(Transport& transport, std::span<const EffectKind> kinds)
    : transport_(transport) {
  for (const EffectKind kind : kinds)
    slots_.push_back({.effect = {.kind = kind, .length = kLength}});
}

expected<void, SetupError> EffectBank::start(double gain, bool has_autocenter) {
  const auto failure = [this](const std::string& what, int error, const char* remedy) {
    stop();
    return setup_error("the input device refuses " + what, system_error(error), remedy);
  };
  if (has_autocenter) {
    const int error = transport_.disable_autocenter();
    if (error != 0) return failure("to end its own spring", error, "plug it in again");
  }
  if (gain >= 0) {
    const int error = transport_.set_gain(gain);
    if (error != 0) return failure("its gain", error, "plug it in again");
  }
  for (Slot& slot : slots_) {
    const int error = transport_.upload(slot.effect);
    if (error == 0) continue;
    const char* const remedy = error == ENOSPC
                                   ? "end the program that holds its effects, such as a game"
                                   : "plug it in again";
    return failure(kNamesOfKinds[static_cast<std::size_t>(slot.effect.kind)], error, remedy);
  }
  return {};
}

EffectStatus EffectBank::update(const Levels& levels, MonotonicTime now) noexcept {
  bool is_refused = false;
  for (Slot& slot : slots_) {
    const int error = update(slot, levels, now);
    if (error == ENODEV) return EffectStatus::kGone;
    is_refused = is_refused || error != 0;
    note_applied(slot);
  }
  if (!is_refused) {
    refusal_count_ = 0;
    return EffectStatus::kOk;
  }
  return ++refusal_count_ < kRefusalMax ? EffectStatus::kRefused : EffectStatus::kGone;
}

/// An effect whose level can't be set keeps its previous level, so it is stopped.
int EffectBank::update(Slot& slot, const Levels& levels, MonotonicTime now) noexcept {
  Effect wanted = slot.effect;
  int error = 0;
  if (set_level(wanted, levels)) {
    if (!is_same_level(wanted, slot.effect)) error = transport_.upload(wanted);
    if (error == 0) {
      slot.effect = wanted;
      if (slot.is_playing && now - slot.started_at < kRefresh) return 0;
      error = transport_.play(slot.effect.id, true);
      slot.started_at = now;
      slot.is_playing = slot.is_playing || error == 0;
      if (error == 0) return 0;
    }
  }
  if (!slot.is_playing) return error;
  const int stop_error = transport_.play(slot.effect.id, false);
  slot.is_playing = stop_error != 0;
  return error != 0 ? error : stop_error;
}

void EffectBank::note_applied(const Slot& slot) noexcept {
  const Effect playing = slot.is_playing ? slot.effect : Effect{};
  switch (slot.effect.kind) {
    case EffectKind::kConstant:
      applied_.effort = playing.level;
      break;
    case EffectKind::kRumble:
      applied_.strong = playing.strong;
      applied_.weak = playing.weak;
      break;
    case EffectKind::kSpring:
      applied_.spring = playing.coefficient;
      break;
    case EffectKind::kDamper:
      applied_.damper = playing.coefficient;
      break;
  }
}

/// Stops all effects before it erases any, so that the force ends as early as possible.
void EffectBank::stop() noexcept {
  const auto insist = [](auto&& write) {
    for (int attempt = 0; attempt < kStopAttemptMax && write() != 0; ++attempt) {
    }
  };
  for (Slot& slot : slots_) {
    if (slot.effect.id >= 0) insist([&] { return transport_.play(slot.effect.id, false); });
    slot.is_playing = false;
  }
  for (Slot& slot : slots_) {
    if (slot.effect.id >= 0) insist([&] { return transport_.erase(slot.effect.id); });
    slot.effect.id = -1;
  }
  applied_ = {};
}

}  // namespace rtpm::device_evdev
