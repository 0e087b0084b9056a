#include "http.hpp"

#include <curl/curl.h>

#include <algorithm>
#include <chrono>
#include <string_view>

#include "rtpm/rt/clock.hpp"

namespace rtpm::etcd_store {
namespace {

using namespace std::chrono_literals;

constexpr Duration kConnectPatience = 500ms;

/// Called once per program, before any other use.
void prepare_curl() {
  static const CURLcode prepared = curl_global_init(CURL_GLOBAL_NOTHING);
  static_cast<void>(prepared);
}

struct FreeHandle {
  void operator()(CURL* handle) const noexcept { curl_easy_cleanup(handle); }
};
struct FreeMulti {
  void operator()(CURLM* multi) const noexcept { curl_multi_cleanup(multi); }
};
struct FreeHeaders {
  void operator()(curl_slist* headers) const noexcept { curl_slist_free_all(headers); }
};
using Handle = std::unique_ptr<CURL, FreeHandle>;
using Headers = std::unique_ptr<curl_slist, FreeHeaders>;

long milliseconds_of(Duration duration) noexcept {
  return std::max<long>(1, static_cast<long>(duration / 1ms));
}

Headers json_headers() {
  curl_slist* const first = curl_slist_append(nullptr, "Content-Type: application/json");
  return Headers(curl_slist_append(first, "Expect:"));
}

/// Sets the options of every request: no proxy from the environment, no redirection, no signals.
void set_common(CURL* handle, const curl_slist* headers, const std::string& url,
                const std::string& body) {
  curl_easy_setopt(handle, CURLOPT_URL, url.c_str());
  curl_easy_setopt(handle, CURLOPT_PROTOCOLS_STR, "http");
  curl_easy_setopt(handle, CURLOPT_PROXY, "");
  curl_easy_setopt(handle, CURLOPT_NOSIGNAL, 1L);
  curl_easy_setopt(handle, CURLOPT_TCP_NODELAY, 1L);
  curl_easy_setopt(handle, CURLOPT_HTTPHEADER, headers);
  curl_easy_setopt(handle, CURLOPT_POSTFIELDSIZE, static_cast<long>(body.size()));
  curl_easy_setopt(handle, CURLOPT_COPYPOSTFIELDS, body.c_str());
  curl_easy_setopt(handle, CURLOPT_CONNECTTIMEOUT_MS, milliseconds_of(kConnectPatience));
}

std::size_t append(char* bytes, std::size_t size, std::size_t count, void* to) {
  auto& text = *static_cast<std::string*>(to);
  if (text.size() + size * count > kReplySizeMax) return 0;
  text.append(bytes, size * count);
  return size * count;
}

int is_over(void* flag, curl_off_t, curl_off_t, curl_off_t, curl_off_t) {
  return *static_cast<const std::atomic<bool>*>(flag) ? 1 : 0;
}

std::string words_of(CURLcode code) {
  if (code == CURLE_WRITE_ERROR) return "it answers with more than 32 MiB";
  if (code == CURLE_OPERATION_TIMEDOUT) return "it does not answer in time";
  return curl_easy_strerror(code);
}

}  // namespace

struct HttpClient::Impl {
  Handle handle{curl_easy_init()};
  Headers headers = json_headers();
};

HttpClient::HttpClient(const std::atomic<bool>& is_stopping) {
  prepare_curl();
  impl_ = std::make_unique<Impl>();
  CURL* const handle = impl_->handle.get();
  curl_easy_setopt(handle, CURLOPT_NOPROGRESS, 0L);
  curl_easy_setopt(handle, CURLOPT_XFERINFOFUNCTION, is_over);
  curl_easy_setopt(handle, CURLOPT_XFERINFODATA, &is_stopping);
}
HttpClient::~HttpClient() = default;

expected<HttpReply, HttpError> HttpClient::post(const std::string& url, const std::string& body,
                                                Duration patience) {
  CURL* const handle = impl_->handle.get();
  if (handle == nullptr) return unexpected{HttpError{"out of memory", false}};
  HttpReply reply;
  set_common(handle, impl_->headers.get(), url, body);
  curl_easy_setopt(handle, CURLOPT_TIMEOUT_MS, milliseconds_of(patience));
  curl_easy_setopt(handle, CURLOPT_WRITEFUNCTION, append);
  curl_easy_setopt(handle, CURLOPT_WRITEDATA, &reply.body);
  const CURLcode done = curl_easy_perform(handle);
  if (done != CURLE_OK) {
    curl_off_t connected_us = 0;
    curl_easy_getinfo(handle, CURLINFO_PRETRANSFER_TIME_T, &connected_us);
    const bool is_connected = connected_us > 0 && done != CURLE_COULDNT_CONNECT;
    return unexpected{HttpError{words_of(done), is_connected, done == CURLE_WRITE_ERROR}};
  }
  curl_easy_getinfo(handle, CURLINFO_RESPONSE_CODE, &reply.status);
  return reply;
}

struct HttpStream::Impl {
  std::unique_ptr<CURLM, FreeMulti> multi{curl_multi_init()};
  Handle handle{};
  Headers headers = json_headers();
  std::string received{};
  std::size_t searched = 0;  ///< The leading bytes already searched for an end of line.
  std::atomic<bool> is_woken = false;

  std::optional<std::string> take_line() {
    const std::size_t end = received.find('\n', searched);
    if (end == std::string::npos) {
      searched = received.size();
      return std::nullopt;
    }
    std::string line = received.substr(0, end);
    received.erase(0, end + 1);
    searched = 0;
    return line;
  }
  /// Why the transfer ended; nullopt while it is running.
  std::optional<std::string> end() {
    int left = 0;
    while (const CURLMsg* const message = curl_multi_info_read(multi.get(), &left)) {
      if (message->msg != CURLMSG_DONE) continue;
      const CURLcode code = message->data.result;
      return code == CURLE_OK ? std::string("it ended the watch") : words_of(code);
    }
    return std::nullopt;
  }
};

HttpStream::HttpStream() {
  prepare_curl();
  impl_ = std::make_unique<Impl>();
}
HttpStream::~HttpStream() {
  close();
}

void HttpStream::close() {
  if (!impl_->handle) return;
  curl_multi_remove_handle(impl_->multi.get(), impl_->handle.get());
  impl_->handle.reset();
  impl_->received.clear();
  impl_->searched = 0;
}

void HttpStream::open(const std::string& url, const std::string& body) {
  close();
  impl_->handle.reset(curl_easy_init());
  CURL* const handle = impl_->handle.get();
  if (handle == nullptr) return;
  set_common(handle, impl_->headers.get(), url, body);
  curl_easy_setopt(handle, CURLOPT_TCP_KEEPALIVE, 1L);
  curl_easy_setopt(handle, CURLOPT_WRITEFUNCTION, append);
  curl_easy_setopt(handle, CURLOPT_WRITEDATA, &impl_->received);
  curl_multi_add_handle(impl_->multi.get(), handle);
}

expected<std::optional<std::string>, HttpError> HttpStream::next_line(MonotonicTime until) {
  Impl& impl = *impl_;
  if (!impl.handle) return unexpected{HttpError{"out of memory"}};
  for (;;) {
    if (auto line = impl.take_line()) return line;
    int running = 0;
    curl_multi_perform(impl.multi.get(), &running);
    if (auto line = impl.take_line()) return line;
    if (auto end = impl.end()) return unexpected{HttpError{std::move(*end)}};
    const Duration left = until - rt::now();
    if (left <= Duration{0} || impl.is_woken.exchange(false)) return std::optional<std::string>{};
    curl_multi_poll(impl.multi.get(), nullptr, 0, static_cast<int>(milliseconds_of(left)), nullptr);
  }
}

void HttpStream::wake() noexcept {
  impl_->is_woken = true;
  curl_multi_wakeup(impl_->multi.get());
}

}  // namespace rtpm::etcd_store
