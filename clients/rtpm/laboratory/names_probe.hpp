#pragma once

#include <condition_variable>
#include <cstdint>
#include <map>
#include <mutex>
#include <string>
#include <thread>

#include "laboratory/process.hpp"

namespace rtpm::laboratory {

/// Polls a registry for its names on a separate thread, because a registry that does not answer
/// must not block the caller.
/// @threads  one
class NamesProbe {
 public:
  using Revisions = std::map<std::string, std::uint64_t>;  ///< The revision of each bound name.

  NamesProbe();
  NamesProbe(const NamesProbe&) = delete;
  NamesProbe& operator=(const NamesProbe&) = delete;
  ~NamesProbe();

  /// From now on polls the registry at `url`; if empty, stops polling.
  void ask(const std::string& url);
  /// A descriptor that is readable when an answer has arrived since take().
  [[nodiscard]] int event() const noexcept { return event_.number(); }
  /// The polled registry's latest answer.
  [[nodiscard]] Revisions take();

 private:
  void run();

  Handle event_;
  std::mutex mutex_{};
  std::condition_variable changed_{};
  std::string url_{};
  Revisions answer_{};
  bool is_ending_ = false;
  std::thread thread_{};
};

}  // namespace rtpm::laboratory
