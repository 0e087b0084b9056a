// Any bytes are a message or are refused; what was read is written and read again alike.

#include <cstddef>
#include <cstdint>
#include <vector>

#include "rtpm/base/assert.hpp"
#include "rtpm/ros2/message.hpp"

using namespace rtpm;

namespace {

template <class M>
void read(ConstBytes bytes) {
  const auto message = ros2::decode<M>(bytes);
  if (!message) return;
  std::vector<std::byte> first;
  ros2::encode(*message, first);
  RTPM_ASSERT(first.size() <= 2 * bytes.size() + 64, "it has no more than its bytes");
  const auto again = ros2::decode<M>(first);
  RTPM_ASSERT(again, "its own encoding is read");
  std::vector<std::byte> second;
  ros2::encode(*again, second);
  RTPM_ASSERT(first == second, "and is the same");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const ConstBytes bytes = std::as_bytes(std::span(data + 1, size - 1));
  using Read = void (*)(ConstBytes);
  static constexpr Read kReads[] = {read<ros2::PoseStamped>,
                                    read<ros2::TwistStamped>,
                                    read<ros2::WrenchStamped>,
                                    read<ros2::JointState>,
                                    read<ros2::Bool>,
                                    read<ros2::Empty>,
                                    read<ros2::String>,
                                    read<ros2::DiagnosticArray>,
                                    read<ros2::ParticipantEntitiesInfo>};
  kReads[data[0] % std::size(kReads)](bytes);
  return 0;
}
