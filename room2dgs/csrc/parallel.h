// A small pool of threads. Work is cut into tasks by the caller and never by the number of threads, and every task
// writes to its own place: that is what makes results the same bits on any number of threads.
#pragma once

#include <cstdint>

namespace room2dgs {

// Threads to use from now on (at least 1), the caller's own included.
void set_threads(int count);
int threads();

// Calls task(context, index, worker) for every index in [0, count); `worker` < threads(). Blocks until all are done.
// Tasks are handed out in rising order, dynamically. Not reentrant.
void run_tasks(int64_t count, void* context, void (*task)(void*, int64_t, int));

template <class Body>
void parallel_for(int64_t count, const Body& body) {
  run_tasks(count, const_cast<Body*>(&body),
            [](void* context, int64_t index, int worker) { (*static_cast<const Body*>(context))(index, worker); });
}

}  // namespace room2dgs
