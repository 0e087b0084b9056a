#include <gtest/gtest.h>
#include <windows.h>

#include <aclapi.h>

#include <cstdlib>
#include <filesystem>

#include "rights.hpp"
#include "rtpm/access/files.hpp"
#include "rtpm/test/temporary_folder.hpp"

// Files by their lists of rights.
namespace rtpm::access {

const std::string kRemedyOfReading = "icacls ";
const std::string kRemedyOfWriting = "icacls ";

namespace {

std::wstring wide(const std::string& path) {
  return std::filesystem::path(std::u8string(path.begin(), path.end())).wstring();
}

/// Replaces the list: `rights` to everybody, all to the owner.
void let_everybody(const std::string& path, DWORD rights) {
  std::wstring everybody = L"EVERYONE";
  std::wstring owner = L"CURRENT_USER";
  EXPLICIT_ACCESSW entries[2]{};
  BuildExplicitAccessWithNameW(&entries[0], owner.data(), FILE_ALL_ACCESS, SET_ACCESS,
                               NO_INHERITANCE);
  BuildExplicitAccessWithNameW(&entries[1], everybody.data(), rights, SET_ACCESS, NO_INHERITANCE);
  ACL* list = nullptr;
  ASSERT_EQ(SetEntriesInAclW(rights == 0 ? 1 : 2, entries, nullptr, &list), DWORD{ERROR_SUCCESS});
  // Not SetNamedSecurityInfo(), which in wine adds the rights of the folder.
  SECURITY_DESCRIPTOR descriptor{};
  InitializeSecurityDescriptor(&descriptor, SECURITY_DESCRIPTOR_REVISION);
  SetSecurityDescriptorDacl(&descriptor, TRUE, list, FALSE);
  EXPECT_NE(SetFileSecurityW(wide(path).c_str(), DACL_SECURITY_INFORMATION, &descriptor), 0);
  LocalFree(list);
}

}  // namespace

void keep_for_this_user(const std::string& path) {
  let_everybody(path, 0);
}
void let_others_read(const std::string& path) {
  let_everybody(path, FILE_GENERIC_READ);
}
void let_others_write(const std::string& path) {
  let_everybody(path, FILE_GENERIC_WRITE);
}

bool are_others_allowed(const std::string& path) {
  ACL* list = nullptr;
  PSECURITY_DESCRIPTOR descriptor = nullptr;
  const std::wstring name = wide(path);
  if (GetNamedSecurityInfoW(name.c_str(), SE_FILE_OBJECT, DACL_SECURITY_INFORMATION, nullptr,
                            nullptr, &list, nullptr, &descriptor) != ERROR_SUCCESS) {
    return true;
  }
  bool is_allowed = list == nullptr;
  for (DWORD i = 0; !is_allowed && i < list->AceCount; ++i) {
    void* entry = nullptr;
    GetAce(list, i, &entry);
    auto* const allowed = static_cast<ACCESS_ALLOWED_ACE*>(entry);
    is_allowed = allowed->Header.AceType == ACCESS_ALLOWED_ACE_TYPE &&
                 IsWellKnownSid(&allowed->SidStart, WinWorldSid) != 0 && allowed->Mask != 0;
  }
  LocalFree(descriptor);
  return is_allowed;
}

namespace {

TEST(KeyFolder, ComesFromTheEnvironment) {
  ASSERT_EQ(_wputenv(L"RTPM_KEYS=C:/J\u00f6rg's keys"), 0);
  EXPECT_EQ(*key_file_path("", kKeyFile), "C:/Jörg's keys/key");
  EXPECT_EQ(*key_file_path("here", kKeyFile), "here");
  ASSERT_EQ(_putenv("RTPM_KEYS="), 0);
  ASSERT_EQ(_wputenv(L"APPDATA=C:\\J\u00f6rg"), 0);
  EXPECT_EQ(*key_folder(), "C:\\Jörg\\rtpm");
  ASSERT_EQ(_putenv("APPDATA="), 0);
  EXPECT_FALSE(key_folder());
}

TEST(Devices, AreNoFilesOfKeys) {
  EXPECT_FALSE(read_key("NUL"));
  EXPECT_FALSE(read_trusted_file("NUL"));
}

}  // namespace
}  // namespace rtpm::access
