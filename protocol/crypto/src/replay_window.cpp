#include "rtpm/crypto/replay_window.hpp"

#include <algorithm>

namespace rtpm::crypto {

bool ReplayWindow::is_new(std::uint64_t counter) const noexcept {
  if (counter >= next_) return true;
  if (next_ - counter > kSize) return false;
  return (bits_[counter / kBlockBits % kBlocks] >> (counter % kBlockBits) & 1) == 0;
}

void ReplayWindow::add(std::uint64_t counter) noexcept {
  if (counter >= next_) {
    // The blocks between the old and the new front hold outdated bits.
    const std::uint64_t newest = counter / kBlockBits;
    const std::uint64_t before = next_ == 0 ? 0 : (next_ - 1) / kBlockBits;
    const std::uint64_t passed = std::min(newest - before, kBlocks);
    for (std::uint64_t i = 0; i < passed; ++i)
      bits_[(newest - i) % kBlocks] = 0;
    next_ = counter + 1;
  }
  bits_[counter / kBlockBits % kBlocks] |= std::uint64_t{1} << (counter % kBlockBits);
}

}  // namespace rtpm::crypto
