#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "evdev_model.hpp"

namespace rtpm::test {

/// A machine of umockdev with one input device: its node, whose ioctls and writes are answered by a
/// model, and what udev says of it.
/// @threads  one at a time
class EmulatedNode {
 public:
  explicit EmulatedNode(EvdevModel& model);
  EmulatedNode(const EmulatedNode&) = delete;
  EmulatedNode& operator=(const EmulatedNode&) = delete;
  ~EmulatedNode();

  /// Makes the node of the model's unit; after unplug() it is another one.
  void plug_in();
  void unplug();
  /// A second device that is described as this one, at another port.
  void add_twin();
  /// Events as the kernel gives them, with the present time.
  void send(const std::vector<device_evdev::Event>& events) const;
  /// Part of an event, and later its rest.
  void send_bytes(std::size_t count) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::test
