#pragma once

#include "rtpm/test/temporary_folder.hpp"

namespace rtpm::rpc::test {

/// Files of keys and grants that only this user can write.
using KeyFolder = rtpm::test::TemporaryFolder;

}  // namespace rtpm::rpc::test
