#pragma once

#include <cstdint>

#if defined(_MSC_VER)
#include <intrin.h>
#endif

/// Requests to the compiler that C++ can't express. No other file differs by compiler.
namespace rtpm::inline base {

/// Prefetches the cache line at `address` for writing.
inline void prefetch_for_write(const void* address) noexcept {
#if defined(_MSC_VER)
  _m_prefetchw(address);
#elif defined(__x86_64__)
  // Compilers emit prefetchw only for processors known to have it; elsewhere it has no effect.
  __asm__ volatile("prefetchw %0" : : "m"(*static_cast<const char*>(address)));
#else
  __builtin_prefetch(address, 1);
#endif
}

/// Keeps the compiler from merging the load of `value` with those of its neighbours.
inline void load_alone(std::uint64_t& value) noexcept {
#if defined(_MSC_VER)
  static_cast<void>(value);
  _ReadWriteBarrier();
#else
  __asm__("" : "+r"(value));
#endif
}

/// Two compilers with the same number lay out the same types alike.
#if defined(_MSC_VER)
inline constexpr std::uint32_t kCompilerAbi = _MSC_VER / 100;
#else
inline constexpr std::uint32_t kCompilerAbi = __GXX_ABI_VERSION;
#endif

}  // namespace rtpm::inline base
