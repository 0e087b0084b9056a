#pragma once

#include <cstdint>
#include <vector>

#include "rtpm/base/bytes.hpp"

namespace rtpm::sim {

/// A request or reply whose every byte follows from its token, so that a byte of another message,
/// or at another offset, shows: token, run number, size of the wanted reply, then filling.
struct Message {
  static constexpr std::size_t kSizeMin = 16;

  std::uint64_t token = 0;
  std::uint32_t run_number = 0;
  std::uint32_t reply_size = 0;

  /// `size` is at least kSizeMin.
  void write(MutableBytes to) const {
    ByteWriter writer(to);
    writer.put(token);
    writer.put(run_number);
    writer.put(reply_size);
    for (std::size_t i = kSizeMin; i < to.size(); ++i)
      to[i] = filling(i);
  }
  [[nodiscard]] static Message read(ConstBytes from) {
    ByteReader reader(from);
    Message message;
    message.token = reader.take<std::uint64_t>();
    message.run_number = reader.take<std::uint32_t>();
    message.reply_size = reader.take<std::uint32_t>();
    return message;
  }
  [[nodiscard]] bool has_its_filling(ConstBytes from) const {
    for (std::size_t i = kSizeMin; i < from.size(); ++i) {
      if (from[i] != filling(i)) return false;
    }
    return from.size() >= kSizeMin;
  }

 private:
  [[nodiscard]] std::byte filling(std::size_t i) const {
    return static_cast<std::byte>(token * 31 + run_number * 17 + i * 7 + (i >> 8));
  }
};

}  // namespace rtpm::sim
