#pragma once

#include <condition_variable>
#include <cstdint>
#include <map>
#include <mutex>
#include <string>
#include <thread>

#include "laboratory/process.hpp"

namespace rtpm::laboratory {

/// Asks a registry for its names again and again, on a thread of its own, because a registry that
/// does not answer must not keep the caller.
/// @threads  one
class NamesProbe {
 public:
  using Revisions = std::map<std::string, std::uint64_t>;  ///< Of each bound name.

  NamesProbe();
  NamesProbe(const NamesProbe&) = delete;
  NamesProbe& operator=(const NamesProbe&) = delete;
  ~NamesProbe();

  /// Asks the registry at `url` from now on; empty: none.
  void ask(const std::string& url);
  /// A descriptor that is readable when an answer has come since take().
  [[nodiscard]] int event() const noexcept { return event_.number(); }
  /// The latest answer of the registry that is asked.
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
