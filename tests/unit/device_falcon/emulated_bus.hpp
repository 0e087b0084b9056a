#pragma once

#include <memory>
#include <string>
#include <vector>

#include "falcon_model.hpp"

namespace rtpm::test {

/// A USB bus with models of Falcons, behind the real libusb: umockdev stands in for the kernel. The
/// models run in this machine's time; access them in with_model() only.
/// @threads  one at a time; umockdev answers from a thread of its own
class EmulatedBus {
 public:
  EmulatedBus();
  EmulatedBus(const EmulatedBus&) = delete;
  EmulatedBus& operator=(const EmulatedBus&) = delete;
  ~EmulatedBus();

  /// @param port  from 1; the unit is then at "1-<port>"
  /// @param address  at least 2, and different each time
  void plug_in(const std::shared_ptr<FalconModel>& model, int port, int address);
  void unplug(const std::shared_ptr<FalconModel>& model);

  /// Calls `use` with the model while nothing else uses it.
  template <class Use>
  auto with_model(const std::shared_ptr<FalconModel>& model, Use&& use) {
    const Lock lock(*this);
    return use(*model);
  }

 private:
  struct Parts;
  /// Keeps umockdev's thread off the models.
  class Lock {
   public:
    explicit Lock(EmulatedBus& bus);
    Lock(const Lock&) = delete;
    Lock& operator=(const Lock&) = delete;
    ~Lock();

   private:
    EmulatedBus& bus_;
  };

  std::unique_ptr<Parts> parts_;
};

}  // namespace rtpm::test
