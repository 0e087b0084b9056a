#pragma once

#include <windows.h>

namespace rtpm::rt::os {

/// Sets the least and the most memory of this process that stays resident; Windows' error, or 0.
/// @param flags  of SetProcessWorkingSetSizeEx()
/// @realtime set-up only
[[nodiscard]] DWORD set_working_set(SIZE_T least, SIZE_T most, DWORD flags) noexcept;

}  // namespace rtpm::rt::os
