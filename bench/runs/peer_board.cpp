#include "runs/peer_board.hpp"

#include <sys/mman.h>
#include <unistd.h>

#include <cerrno>
#include <ctime>
#include <new>
#include <utility>

#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/native_time.hpp"

namespace rtpm::bench {
namespace {

void* map_board(int file) {
  return mmap(nullptr, sizeof(PeerBoard), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_POPULATE, file,
              0);
}

}  // namespace

void PeerBoard::wait_for_plan() noexcept {
  while (sem_wait(&asked) != 0) {
  }
}

bool PeerBoard::run_plan(Duration patience) noexcept {
  sem_post(&asked);
  const timespec end = rt::to_timespec(rt::now() + patience);
  while (sem_clockwait(&answered, CLOCK_MONOTONIC, &end) != 0) {
    if (errno != EINTR) return false;
  }
  return true;
}

expected<SharedBoard, std::string> SharedBoard::create() {
  const int file = memfd_create("rtpm-bench-peer", 0);
  if (file < 0 || ftruncate(file, sizeof(PeerBoard)) != 0) {
    return unexpected{std::string("no shared memory for a peer's board")};
  }
  void* const memory = map_board(file);
  if (memory == MAP_FAILED) return unexpected{std::string("a peer's board can't be mapped")};
  auto* const board = new (memory) PeerBoard{};
  sem_init(&board->asked, 1, 0);
  sem_init(&board->answered, 1, 0);
  return SharedBoard(file, board);
}

expected<SharedBoard, std::string> SharedBoard::open(int file) {
  void* const memory = map_board(file);
  if (memory == MAP_FAILED) {
    return unexpected{std::string("this program is started by rtpm-bench, which hands it a board")};
  }
  return SharedBoard(file, static_cast<PeerBoard*>(memory));
}

SharedBoard::SharedBoard(SharedBoard&& other) noexcept
    : file_(std::exchange(other.file_, -1)), board_(std::exchange(other.board_, nullptr)) {}

SharedBoard::~SharedBoard() {
  if (board_ == nullptr) return;
  munmap(board_, sizeof(PeerBoard));
  close(file_);
}

}  // namespace rtpm::bench
