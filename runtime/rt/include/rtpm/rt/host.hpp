#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace rtpm::rt {

/// The number of a process's monotonic clock, derived from the bytes of
/// /proc/sys/kernel/random/boot_id and the text of the link /proc/self/ns/time; the text is empty
/// if there is no such link (hp-4.1-7).
[[nodiscard]] std::uint64_t clock_domain_of(std::string_view boot_id,
                                            std::string_view time_namespace) noexcept;

/// A number that processes share if and only if their monotonic clocks are the same. Derived from
/// the kernel's boot id and time namespace; 0 if it can't be determined.
/// @realtime set-up only
[[nodiscard]] std::uint64_t clock_domain() noexcept;

/// 64 random bits from the kernel, never 0.
/// @realtime set-up only
[[nodiscard]] std::uint64_t random_u64() noexcept;

/// The name of the program that this process runs, without its folder: "rtpm-deviced".
/// @realtime set-up only
[[nodiscard]] std::string program_name();

/// The name of this machine in its network; empty if it has none.
/// @realtime set-up only
[[nodiscard]] std::string host_name();

/// The version of the operating system's kernel, such as "6.1.0-28-amd64", or "10.0.19045" of
/// Windows; empty if the system does not tell.
/// @realtime set-up only
[[nodiscard]] std::string kernel_version();

/// The CPUs that the calling thread may run on, ascending; empty where the system confines no
/// threads to CPUs.
/// @realtime set-up only
[[nodiscard]] std::vector<int> usable_cpus();

/// The number of CPUs that the calling thread may run on.
/// @realtime set-up only
[[nodiscard]] int usable_cpu_count() noexcept;

}  // namespace rtpm::rt
