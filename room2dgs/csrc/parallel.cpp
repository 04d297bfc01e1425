#include "parallel.h"

#include <atomic>
#include <condition_variable>
#include <mutex>
#include <thread>
#include <vector>

#if defined(__unix__)
#include <pthread.h>
#endif

namespace room2dgs {
namespace {

struct Pool {
  std::mutex run_mutex;  // one parallel region at a time
  std::mutex mutex;
  std::condition_variable wake, finished;
  std::vector<std::thread> workers;
  uint64_t generation = 0;
  int running = 0;
  bool stopping = false;

  int64_t count = 0;
  void* context = nullptr;
  void (*task)(void*, int64_t, int) = nullptr;
  std::atomic<int64_t> next{0};

  void drain(int worker) {
    for (int64_t index = next.fetch_add(1); index < count; index = next.fetch_add(1)) task(context, index, worker);
  }

  void loop(int worker, uint64_t seen) {
    for (;;) {
      {
        std::unique_lock<std::mutex> lock(mutex);
        wake.wait(lock, [&] { return stopping || generation != seen; });
        if (stopping) return;
        seen = generation;
      }
      drain(worker);
      std::lock_guard<std::mutex> lock(mutex);
      if (--running == 0) finished.notify_one();
    }
  }

  void resize(int helpers) {
    {
      std::lock_guard<std::mutex> lock(mutex);
      stopping = true;
    }
    wake.notify_all();
    for (std::thread& worker : workers) worker.join();
    workers.clear();
    stopping = false;
    for (int k = 0; k < helpers; ++k) workers.emplace_back(&Pool::loop, this, k + 1, generation);
  }
};

// Never destroyed: joining threads while the interpreter unloads can hang.
Pool* pool = new Pool;
std::atomic<int> thread_count{1};

#if defined(__unix__)
// A forked child has none of the parent's threads: start afresh there.
void after_fork_in_child() {
  pool = new Pool;
  thread_count = 1;
}
const int registered = pthread_atfork(nullptr, nullptr, after_fork_in_child);
#endif

}  // namespace

void set_threads(int count) {
  std::lock_guard<std::mutex> region(pool->run_mutex);
  count = count < 1 ? 1 : count;
  pool->resize(count - 1);
  thread_count = count;
}

int threads() { return thread_count; }

void run_tasks(int64_t count, void* context, void (*task)(void*, int64_t, int)) {
  if (count <= 0) return;
  std::lock_guard<std::mutex> region(pool->run_mutex);
  if (pool->workers.empty() || count == 1) {
    for (int64_t index = 0; index < count; ++index) task(context, index, 0);
    return;
  }
  {
    std::lock_guard<std::mutex> lock(pool->mutex);
    pool->count = count;
    pool->context = context;
    pool->task = task;
    pool->next = 0;
    pool->running = static_cast<int>(pool->workers.size());
    ++pool->generation;
  }
  pool->wake.notify_all();
  pool->drain(0);
  std::unique_lock<std::mutex> lock(pool->mutex);
  pool->finished.wait(lock, [] { return pool->running == 0; });
}

}  // namespace room2dgs
