#include "os/file.hpp"

// Windows' own header first: the others build on it.
#include <windows.h>
#include <winsock2.h>

#include <aclapi.h>
#include <lmcons.h>
#include <sddl.h>
#include <ws2tcpip.h>

#include <array>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <memory>
#include <span>
#include <type_traits>
#include <vector>

#include "rtpm/base/printable.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/base/utf8_path.hpp"

namespace rtpm::access::os {
namespace {

constexpr DWORD kLockPauseMs = 10;
constexpr DWORD kShareAll = FILE_SHARE_READ | FILE_SHARE_WRITE | FILE_SHARE_DELETE;
/// Rights by which others could change a file, or the rules about it.
constexpr DWORD kToWrite = FILE_WRITE_DATA | FILE_APPEND_DATA | DELETE | WRITE_DAC | WRITE_OWNER |
                           GENERIC_WRITE | GENERIC_ALL;
constexpr DWORD kToRead = FILE_READ_DATA | GENERIC_READ;

HANDLE handle(Number number) noexcept {
  return reinterpret_cast<HANDLE>(number);
}
Number number_of(HANDLE file) noexcept {
  return reinterpret_cast<Number>(file);
}

std::error_code error_of(DWORD number) noexcept {
  return {static_cast<int>(number), std::system_category()};
}
std::error_code last_error() noexcept {
  return error_of(GetLastError());
}

/// Memory that Windows allocated.
struct LocalFreed {
  void operator()(void* memory) const noexcept { LocalFree(memory); }
};
template <class T>
using Local = std::unique_ptr<T, LocalFreed>;

using Sid = std::vector<std::byte>;
PSID as_sid(Sid& sid) noexcept {
  return sid.data();
}

/// The user with whose rights this program runs; empty if the system does not tell.
Sid sid_of_this_user() {
  HANDLE token = nullptr;
  if (OpenProcessToken(GetCurrentProcess(), TOKEN_QUERY, &token) == 0) return {};
  const File closed(number_of(token));
  // The user, and behind it the sub-authorities of its id.
  alignas(TOKEN_USER) std::array<std::byte, sizeof(TOKEN_USER) + SECURITY_MAX_SID_SIZE> user{};
  DWORD size = 0;
  if (GetTokenInformation(token, TokenUser, user.data(), static_cast<DWORD>(user.size()), &size) ==
      0) {
    return {};
  }
  PSID const own = reinterpret_cast<TOKEN_USER*>(user.data())->User.Sid;
  Sid sid(GetLengthSid(own));
  std::memcpy(sid.data(), own, sid.size());
  return sid;
}

Sid sid_of_known(WELL_KNOWN_SID_TYPE type) {
  Sid sid(SECURITY_MAX_SID_SIZE);
  DWORD size = static_cast<DWORD>(sid.size());
  if (CreateWellKnownSid(type, nullptr, as_sid(sid), &size) == 0) return {};
  sid.resize(size);
  return sid;
}

/// The users that may do all on this machine anyhow, and this one.
std::vector<Sid> trusted_sids() {
  std::vector<Sid> trusted{sid_of_this_user(), sid_of_known(WinBuiltinAdministratorsSid),
                           sid_of_known(WinLocalSystemSid)};
  std::erase_if(trusted, [](const Sid& sid) { return sid.empty(); });
  return trusted;
}

bool is_among(std::vector<Sid>& trusted, PSID wanted) noexcept {
  for (Sid& sid : trusted) {
    if (EqualSid(as_sid(sid), wanted) != 0) return true;
  }
  return false;
}

std::string text_of_sid(PSID sid) {
  wchar_t* text = nullptr;
  if (ConvertSidToStringSidW(sid, &text) == 0) return "?";
  const Local<wchar_t> freed(text);
  return utf8_of(std::filesystem::path(text));
}

/// A descriptor that gives a new file or folder to this user, administrators and the system, and
/// takes nothing over from the folder above.
Local<void> private_descriptor() {
  Sid own = sid_of_this_user();
  if (own.empty()) return nullptr;
  const std::string user = text_of_sid(as_sid(own));
  const std::string text = "D:P(A;OICI;FA;;;SY)(A;OICI;FA;;;BA)(A;OICI;FA;;;" + user + ")";
  PSECURITY_DESCRIPTOR made = nullptr;
  ConvertStringSecurityDescriptorToSecurityDescriptorW(path_of_utf8(text).c_str(), SDDL_REVISION_1,
                                                       &made, nullptr);
  return Local<void>(made);
}

SECURITY_ATTRIBUTES attributes_of(PSECURITY_DESCRIPTOR descriptor) noexcept {
  return {sizeof(SECURITY_ATTRIBUTES), descriptor, FALSE};
}

/// The owner and the list of rights of an open file.
struct Security {
  Local<void> descriptor{};
  PSID owner = nullptr;
  ACL* list = nullptr;  ///< Null: everybody has all rights.
};
expected<Security, std::error_code> security_of(Number file) {
  Security security;
  PSECURITY_DESCRIPTOR descriptor = nullptr;
  const DWORD error = GetSecurityInfo(
      handle(file), SE_FILE_OBJECT, OWNER_SECURITY_INFORMATION | DACL_SECURITY_INFORMATION,
      &security.owner, nullptr, &security.list, nullptr, &descriptor);
  if (error != ERROR_SUCCESS) return unexpected{error_of(error)};
  security.descriptor.reset(descriptor);
  return security;
}

/// The first untrusted user who has one of the rights; empty if nobody has.
std::string other_with(const ACL* list, DWORD rights, std::vector<Sid>& trusted) {
  if (list == nullptr) return "everybody";
  for (DWORD i = 0; i < list->AceCount; ++i) {
    void* entry = nullptr;
    if (GetAce(const_cast<ACL*>(list), i, &entry) == 0) return "?";
    const auto* const header = static_cast<const ACE_HEADER*>(entry);
    // Those for files inside a folder, and those that only deny or watch.
    if ((header->AceFlags & INHERIT_ONLY_ACE) != 0) continue;
    if (header->AceType == ACCESS_DENIED_ACE_TYPE || header->AceType == SYSTEM_AUDIT_ACE_TYPE) {
      continue;
    }
    if (header->AceType != ACCESS_ALLOWED_ACE_TYPE) return "?";
    auto* const allowed = static_cast<ACCESS_ALLOWED_ACE*>(entry);
    if ((allowed->Mask & rights) != 0 && !is_among(trusted, &allowed->SidStart))
      return text_of_sid(&allowed->SidStart);
  }
  return {};
}

bool is_regular(Number file) noexcept {
  BY_HANDLE_FILE_INFORMATION found{};
  constexpr DWORD kOthers = FILE_ATTRIBUTE_DIRECTORY | FILE_ATTRIBUTE_REPARSE_POINT;
  return GetFileType(handle(file)) == FILE_TYPE_DISK &&
         GetFileInformationByHandle(handle(file), &found) != 0 &&
         (found.dwFileAttributes & kOthers) == 0;
}

File create(const std::string& path, DWORD disposition, DWORD access,
            PSECURITY_DESCRIPTOR descriptor) {
  SECURITY_ATTRIBUTES attributes = attributes_of(descriptor);
  return File(
      number_of(CreateFileW(path_of_utf8(path).c_str(), access, kShareAll, &attributes, disposition,
                            FILE_ATTRIBUTE_NORMAL | FILE_FLAG_OPEN_REPARSE_POINT, nullptr)));
}

/// The rights of the file that is there, for the one that replaces it; private ones for a new one.
Local<void> descriptor_like(const std::string& path) {
  PSECURITY_DESCRIPTOR found = nullptr;
  ACL* list = nullptr;
  const DWORD error =
      GetNamedSecurityInfoW(path_of_utf8(path).c_str(), SE_FILE_OBJECT, DACL_SECURITY_INFORMATION,
                            nullptr, nullptr, &list, nullptr, &found);
  return error == ERROR_SUCCESS ? Local<void>(found) : private_descriptor();
}

/// Whether a file is open elsewhere, without the permission to replace it.
bool is_in_use(const std::error_code& error) noexcept {
  return error.value() == ERROR_SHARING_VIOLATION || error.value() == ERROR_ACCESS_DENIED ||
         error.value() == ERROR_USER_MAPPED_FILE;
}

}  // namespace

void close(Number number) noexcept {
  CloseHandle(handle(number));
}

expected<File, std::error_code> open(const std::string& path, Mode mode) {
  if (mode == Mode::kRead) {
    File file(number_of(CreateFileW(path_of_utf8(path).c_str(), GENERIC_READ, kShareAll, nullptr,
                                    OPEN_EXISTING, FILE_ATTRIBUTE_NORMAL, nullptr)));
    if (file.number() == kNoFile) return unexpected{last_error()};
    return file;
  }
  const Local<void> descriptor = private_descriptor();
  if (descriptor == nullptr) return unexpected{last_error()};
  constexpr DWORD kOwn = READ_CONTROL | FILE_READ_ATTRIBUTES | SYNCHRONIZE;
  File file = mode == Mode::kCreate
                  ? create(path, CREATE_NEW, GENERIC_WRITE | kOwn, descriptor.get())
                  : create(path, OPEN_ALWAYS, FILE_APPEND_DATA | kOwn, descriptor.get());
  if (file.number() == kNoFile) return unexpected{last_error()};
  return file;
}

expected<std::size_t, std::error_code> read(const File& file, char* to, std::size_t size) noexcept {
  DWORD count = 0;
  if (ReadFile(handle(file.number()), to, static_cast<DWORD>(size), &count, nullptr) == 0)
    return unexpected{last_error()};
  return std::size_t{count};
}

std::error_code write(Number file, std::string_view text) noexcept {
  DWORD count = 0;
  if (WriteFile(handle(file), text.data(), static_cast<DWORD>(text.size()), &count, nullptr) == 0)
    return last_error();
  return count == text.size() ? std::error_code() : error_of(ERROR_DISK_FULL);
}

std::error_code flush(const File& file) noexcept {
  return FlushFileBuffers(handle(file.number())) != 0 ? std::error_code() : last_error();
}

expected<std::optional<Distrust>, std::error_code> distrust_of(const File& file,
                                                               const std::string& path,
                                                               Forbidden forbidden) {
  if (!is_regular(file.number())) return Distrust{"it is no regular file"};
  const auto security = security_of(file.number());
  if (!security) return unexpected{security.error()};
  const std::string quoted = "\"" + printable(path, kShownWhole) + "\"";
  std::vector<Sid> trusted = trusted_sids();
  if (!is_among(trusted, security->owner)) {
    return Distrust{"it belongs to another user, " + text_of_sid(security->owner),
                    "as an administrator: takeown /f " + quoted};
  }
  const bool is_secret = forbidden == Forbidden::kToReadOrWrite;
  const std::string other =
      other_with(security->list, is_secret ? kToRead | kToWrite : kToWrite, trusted);
  if (!other.empty()) {
    return Distrust{(is_secret ? "others can read or write it: " : "others can write it: ") + other,
                    "icacls " + quoted + " /inheritance:r /grant:r \"%USERNAME%:F\""};
  }
  return std::nullopt;
}

bool is_private(Number file) noexcept {
  if (!is_regular(file)) return false;
  const auto security = security_of(file);
  std::vector<Sid> trusted = trusted_sids();
  return security && is_among(trusted, security->owner) &&
         other_with(security->list, kToRead | kToWrite, trusted).empty();
}

std::string_view private_remedy() noexcept {
  return "icacls it /inheritance:r /grant:r \"%USERNAME%:F\"";
}

std::uint64_t size_of(Number file) noexcept {
  LARGE_INTEGER size{};
  return GetFileSizeEx(handle(file), &size) != 0 ? static_cast<std::uint64_t>(size.QuadPart) : 0;
}

void remove(const std::string& path) noexcept {
  DeleteFileW(path_of_utf8(path).c_str());
}

std::error_code rename(const std::string& from, const std::string& to) noexcept {
  constexpr DWORD kFlags = MOVEFILE_REPLACE_EXISTING | MOVEFILE_WRITE_THROUGH;
  return MoveFileExW(path_of_utf8(from).c_str(), path_of_utf8(to).c_str(), kFlags) != 0
             ? std::error_code()
             : last_error();
}

std::error_code make_folder_of(const std::string& path) {
  const std::filesystem::path folder = path_of_utf8(path).parent_path();
  std::error_code error;
  if (folder.empty() || std::filesystem::exists(folder, error)) return {};
  if (folder.has_parent_path()) {
    std::filesystem::create_directories(folder.parent_path(), error);
    if (error) return error;
  }
  const Local<void> descriptor = private_descriptor();
  if (descriptor == nullptr) return last_error();
  SECURITY_ATTRIBUTES attributes = attributes_of(descriptor.get());
  if (CreateDirectoryW(folder.c_str(), &attributes) != 0) return {};
  return GetLastError() == ERROR_ALREADY_EXISTS ? std::error_code() : last_error();
}

expected<std::string, std::error_code> real_path_of(const std::string& path) {
  std::error_code error;
  const std::filesystem::path real = std::filesystem::weakly_canonical(path_of_utf8(path), error);
  if (error) return unexpected{error};
  return utf8_of(real);
}

// The lock is a file beside it, which only one program can open and which goes with its handle: a
// file that is open can't be replaced.
expected<std::optional<File>, std::error_code> lock(const std::string& path) {
  const HANDLE file =
      CreateFileW(path_of_utf8(path + ".lock").c_str(), GENERIC_WRITE | DELETE, 0, nullptr,
                  CREATE_ALWAYS, FILE_ATTRIBUTE_HIDDEN | FILE_FLAG_DELETE_ON_CLOSE, nullptr);
  if (file != INVALID_HANDLE_VALUE) return std::optional<File>(File(number_of(file)));
  // Access is also denied while the lock before is being deleted; the caller tries for some time.
  const std::error_code error = last_error();
  if (is_in_use(error)) return std::nullopt;
  return unexpected{error};
}

expected<bool, std::error_code> replace(const File&, const std::string& path,
                                        std::string_view text) {
  const std::string next = path + ".new";
  remove(next);  // Left by a program that died halfway: this process holds the lock.
  std::error_code error;
  {
    const Local<void> descriptor = descriptor_like(path);
    if (descriptor == nullptr) return unexpected{last_error()};
    const File file = create(next, CREATE_NEW, GENERIC_WRITE, descriptor.get());
    if (file.number() == kNoFile) return unexpected{last_error()};
    error = write(file.number(), text);
    if (!error) error = flush(file);
  }
  if (!error) error = rename(next, path);
  if (!error) return true;
  remove(next);
  if (is_in_use(error)) return false;
  return unexpected{error};
}

void pause() noexcept {
  Sleep(kLockPauseMs);
}

std::string variable(const char* name) {
  // NOLINTNEXTLINE(concurrency-mt-unsafe): set-up.
  const wchar_t* const value = _wgetenv(path_of_utf8(name).c_str());
  return value == nullptr ? std::string() : utf8_of(std::filesystem::path(value));
}

std::string default_key_folder() {
  const std::string folder = variable("APPDATA");
  return folder.empty() ? folder : folder + "\\rtpm";
}

std::string_view key_folder_variables() noexcept {
  return "APPDATA";
}

FileStamp stamp_of(const std::string& path) noexcept {
  const File file(
      number_of(CreateFileW(path_of_utf8(path).c_str(), FILE_READ_ATTRIBUTES, kShareAll, nullptr,
                            OPEN_EXISTING, FILE_FLAG_BACKUP_SEMANTICS, nullptr)));
  BY_HANDLE_FILE_INFORMATION found{};
  FILE_BASIC_INFO times{};
  if (file.number() == kNoFile || GetFileInformationByHandle(handle(file.number()), &found) == 0 ||
      GetFileInformationByHandleEx(handle(file.number()), FileBasicInfo, &times, sizeof times) ==
          0) {
    return {};
  }
  constexpr std::int64_t kNsPerTick = 100;
  const std::uint64_t index = std::uint64_t{found.nFileIndexHigh} << 32U | found.nFileIndexLow;
  const std::uint64_t size = std::uint64_t{found.nFileSizeHigh} << 32U | found.nFileSizeLow;
  // Since 1970 instead of 1601, as nanoseconds of four centuries do not fit.
  constexpr std::int64_t kUnixEpoch = 116'444'736'000'000'000;
  return {index == 0 ? 1 : index, (times.ChangeTime.QuadPart - kUnixEpoch) * kNsPerTick,
          static_cast<std::int64_t>(size)};
}

std::string user_at_host() {
  std::array<wchar_t, UNLEN + 1> user{};
  std::array<wchar_t, 256> host{};
  auto user_size = static_cast<DWORD>(user.size());
  auto host_size = static_cast<DWORD>(host.size());
  if (GetUserNameW(user.data(), &user_size) == 0 ||
      GetComputerNameExW(ComputerNameDnsHostname, host.data(), &host_size) == 0) {
    return {};
  }
  return utf8_of(user.data()) + "@" + utf8_of(host.data());
}

// Windows has no numbers of users. The last part of the user's id tells those of one machine apart.
std::uint32_t this_user() noexcept {
  constexpr std::uint32_t kNobody = 0xffff'ffff;
  Sid own = sid_of_this_user();
  if (own.empty()) return kNobody;
  PSID const sid = as_sid(own);
  const UCHAR count = *GetSidSubAuthorityCount(sid);
  return count == 0 ? kNobody : *GetSidSubAuthority(sid, count - 1U);
}

bool parse_ipv6(const std::string& text, std::uint8_t* to) noexcept {
  return InetPtonA(AF_INET6, text.c_str(), to) == 1;
}

bool parse_ipv4(const std::string& text, std::uint8_t* to) noexcept {
  return InetPtonA(AF_INET, text.c_str(), to) == 1;
}

}  // namespace rtpm::access::os
