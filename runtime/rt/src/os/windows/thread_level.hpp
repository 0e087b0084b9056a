#pragma once

namespace rtpm::rt::os {

/// Takes the calling thread out of the multimedia class, before it ends.
/// @realtime set-up only
void leave_multimedia_class() noexcept;

}  // namespace rtpm::rt::os
