#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "evdev_model.hpp"

namespace rtpm::test {

/// An umockdev machine with one input device: a model answers the ioctls and writes of its node,
/// and udev describes the device.
/// @threads  one at a time
class EmulatedNode {
 public:
  explicit EmulatedNode(EvdevModel& model);
  EmulatedNode(const EmulatedNode&) = delete;
  EmulatedNode& operator=(const EmulatedNode&) = delete;
  ~EmulatedNode();

  /// Creates the node of the model's unit; after unplug() this is another node.
  void plug_in();
  void unplug();
  /// Sends events as the kernel does, with the present time.
  void send(const std::vector<device_evdev::Event>& events) const;
  /// Sends a part of an event, and in a later call the rest.
  void send_bytes(std::size_t count) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtpm::test
