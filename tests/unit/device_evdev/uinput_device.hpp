#pragma once

#include <linux/uinput.h>

#include <atomic>
#include <cstdint>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

namespace rtpm::test {

/// An input device of this machine's kernel that a program emulates through /dev/uinput. Its own
/// thread answers the kernel's requests for effects.
/// @threads  any, except construction and destruction
class UinputDevice {
 public:
  struct Axis {
    std::uint16_t code = 0;
    std::int32_t minimum = 0;
    std::int32_t maximum = 0;
  };
  struct Description {
    std::string name;
    std::vector<Axis> axes{};
    std::vector<std::uint16_t> keys{};
    std::vector<std::uint16_t> effects{};
  };

  /// The reason why this process can't create one; empty if it can.
  [[nodiscard]] static std::string obstacle();

  /// Waits until its node exists, at most 2 s.
  explicit UinputDevice(const Description& description);
  UinputDevice(const UinputDevice&) = delete;
  UinputDevice& operator=(const UinputDevice&) = delete;
  /// Unplugs it.
  ~UinputDevice();

  /// "/dev/input/event5"; empty if the kernel created none.
  [[nodiscard]] const std::string& node() const noexcept { return node_; }
  void send(std::uint16_t type, std::uint16_t code, std::int32_t value) const;

  /// The level of the playing effects of `type`: their only level, the strong motor's level of a
  /// rumble, or a coefficient; 0 if none plays.
  [[nodiscard]] int level(std::uint16_t type) const;
  [[nodiscard]] std::size_t effect_count() const;
  [[nodiscard]] int gain() const { return gain_.load(); }

 private:
  void serve();
  void take(const input_event& event);
  void upload(std::uint32_t request);
  void erase(std::uint32_t request);
  void find_node();

  int file_;
  std::string node_{};
  mutable std::mutex mutex_{};
  std::map<int, ff_effect> effects_{};
  std::map<int, bool> is_playing_{};
  std::atomic<int> gain_{-1};
  std::atomic<bool> is_ending_{false};
  std::thread thread_{};
};

}  // namespace rtpm::test
