#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "hid_model.hpp"

namespace rtpm::test {

/// Device models as hidraw nodes of umockdev, behind the real hidapi, udev and system calls. A
/// thread advances the models' time with the clock and hands over their reports one by one: a node
/// is a pseudo-terminal, which keeps no boundaries between reports.
class EmulatedHidraw {
 public:
  EmulatedHidraw();
  EmulatedHidraw(const EmulatedHidraw&) = delete;
  EmulatedHidraw& operator=(const EmulatedHidraw&) = delete;
  ~EmulatedHidraw();

  /// @param number  the node's number: 3 is /dev/hidraw3
  void plug(std::shared_ptr<HidModel> model, int number, const std::string& serial,
            const std::string& port);
  void unplug(int number);
  /// Calls `use` with the model of that node while nothing else uses it.
  template <class Use>
  auto with_model(int number, Use&& use) {
    HidModel& model = model_of(number);
    const std::lock_guard lock(mutex_);
    return use(model);
  }

  struct Node;

 private:
  [[nodiscard]] HidModel& model_of(int number);
  void run();

  struct Testbed;
  std::mutex mutex_{};        ///< Guards the models.
  std::mutex nodes_mutex_{};  ///< Guards the list of nodes; locked first.
  std::unique_ptr<Testbed> testbed_;
  std::vector<std::unique_ptr<Node>> nodes_{};
  std::vector<std::unique_ptr<Node>> unplugged_{};
  std::atomic<bool> is_stopping_{false};
  std::thread thread_{};
};

}  // namespace rtpm::test
