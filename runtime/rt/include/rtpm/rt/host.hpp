#pragma once

#include <cstdint>
#include <vector>

namespace rtpm::rt {

/// A number that processes share if and only if their monotonic clocks are the same clock: drawn
/// from the kernel's boot id and time namespace. 0 when the system does not tell.   Set-up only.
[[nodiscard]] std::uint64_t clock_domain() noexcept;

/// 64 random bits from the kernel, never 0.   Set-up only.
[[nodiscard]] std::uint64_t random_u64() noexcept;

/// The CPUs that the calling thread may run on, ascending.   Set-up only.
[[nodiscard]] std::vector<int> usable_cpus();

/// How many CPUs the calling thread may run on.   Set-up only.
[[nodiscard]] int usable_cpu_count() noexcept;

}  // namespace rtpm::rt
