#include "client/rebinder.hpp"

#include <algorithm>
#include <optional>

#include "client/binding_impl.hpp"
#include "client/node_impl.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::rpc {
namespace {

// How soon previous destinations that a call still uses are checked again.
constexpr Duration kFreeInterval = std::chrono::milliseconds{100};

}  // namespace

bool Rebinder::Name::is_wanted() const noexcept {
  return std::ranges::any_of(bindings,
                             [](const Binding::Impl* binding) { return binding->wants_name(); });
}

Rebinder::~Rebinder() {
  {
    const Lock lock(mutex_);
    is_stopping_ = true;
  }
  bell_.post();
  if (thread_.is_running()) thread_.join();
}

expected<void, SetupError> Rebinder::add(Binding::Impl& binding) {
  const Lock lock(mutex_);
  if (!thread_.is_running()) {
    auto thread = rt::Thread::start({.name = "rtpm-rebind", .realtime = rt::RealtimeMode::kOff},
                                    [this] { run(); });
    if (!thread) return unexpected{std::move(thread.error())};
    thread_ = std::move(*thread);
  }
  names_[binding.name()].bindings.push_back(&binding);
  return {};
}

void Rebinder::remove(Binding::Impl& binding) noexcept {
  {
    const Lock lock(mutex_);
    const auto found = names_.find(binding.name());
    if (found != names_.end()) {
      Name& name = found->second;
      std::erase(name.bindings, &binding);
      // Keeps the time of the last look-up as long as it matters.
      if (name.bindings.empty() && rt::now() - name.last >= kCalm) names_.erase(found);
    }
    if (current_ != &binding) return;
  }
  const Lock is_done(working_);
}

void Rebinder::look_again(std::string_view at) noexcept {
  {
    const Lock lock(mutex_);
    for (auto& [text, name] : names_) {
      const bool is_below =
          text.size() > at.size() && text.starts_with(at) && text[at.size()] == '/';
      if (text != at && !is_below) continue;
      name.leads_elsewhere = true;
      for (Binding::Impl* const binding : name.bindings)
        binding->set_wants_name(true);
    }
  }
  bell_.post();
}

void Rebinder::use(Resolver* resolver) noexcept {
  {
    const Lock lock(mutex_);
    resolver_.store(resolver, std::memory_order_release);
    if (!is_asking_) return;
  }
  const Lock is_done(working_);
}

void Rebinder::run() {
  while (true) {
    MonotonicTime next = kNever;
    {
      Lock lock(mutex_);
      if (is_stopping_) return;
      next = serve(lock);
    }
    static_cast<void>(bell_.wait_until(next));
  }
}

// Looks up the names that are due; returns when to continue.
MonotonicTime Rebinder::serve(Lock& lock) {
  MonotonicTime next = kNever;
  std::vector<std::string> due;
  const MonotonicTime now = rt::now();
  std::erase_if(names_, [&](const auto& entry) {
    return entry.second.bindings.empty() && now - entry.second.last >= kCalm;
  });
  for (auto& [text, name] : names_) {
    for (Binding::Impl* const binding : name.bindings) {
      if (!binding->destinations().free_former()) next = std::min(next, now + kFreeInterval);
    }
    if (!name.is_wanted()) continue;
    if (now - name.last >= kCalm) name.interval = kFirstInterval;
    const Duration interval = name.leads_elsewhere ? kPromptInterval : name.interval;
    if (name.last != MonotonicTime{} && now < name.last + interval) {
      next = std::min(next, name.last + interval);
    } else {
      due.push_back(text);
    }
  }
  for (const std::string& name : due) {
    if (is_stopping_) return next;
    look_up(lock, name);
  }
  return due.empty() ? next : rt::now();
}

void Rebinder::look_up(Lock& lock, const std::string& text) {
  Name& name = names_[text];
  name.leads_elsewhere = false;
  name.interval = name.last == MonotonicTime{} || rt::now() - name.last >= kCalm
                      ? kFirstInterval
                      : std::min(2 * name.interval, kLongestInterval);
  Resolver* const resolver = resolver_.load(std::memory_order_acquire);
  expected<std::string, SetupError> url = setup_error("name '" + text + "' can't be resolved",
                                                      "this program uses no registry any more");
  if (resolver != nullptr) {
    is_asking_ = true;
    {
      const Lock work(working_);
      lock.unlock();
      url = resolver->resolve(text, rt::now() + kResolveDeadline);
    }
    lock.lock();
    is_asking_ = false;
  }
  names_[text].last = rt::now();
  bind(lock, text, url);
}

void Rebinder::bind(Lock& lock, const std::string& text,
                    const expected<std::string, SetupError>& url) {
  // Bindings may be added or removed while the lock is released.
  const std::vector<Binding::Impl*> bindings = names_[text].bindings;
  for (Binding::Impl* const binding : bindings) {
    const std::vector<Binding::Impl*>& present = names_[text].bindings;
    if (std::ranges::find(present, binding) == present.end() || is_stopping_) continue;
    if (!binding->wants_name()) continue;
    if (!url) {
      binding->note_unresolved(url.error().text());
      continue;
    }
    // A call that fails from here on requests another look-up.
    binding->set_wants_name(false);
    current_ = binding;
    {
      const Lock work(working_);
      lock.unlock();
      // Inside the lock, because the binding may be destroyed as soon as the lock is released.
      if (!binding->follow(*url)) binding->set_wants_name(true);
    }
    lock.lock();
    current_ = nullptr;
  }
  if (Name& name = names_[text]; !name.is_wanted()) name.interval = kFirstInterval;
}

}  // namespace rtpm::rpc
