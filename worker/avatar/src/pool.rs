//! Work on a thread of rayon's pool.

use burn::tensor::StreamId;
use tracing::{Dispatch, Span, dispatcher};

/// Does `work` on a thread of the pool, with the caller's log and on the caller's stream of the device. From any other thread,
/// each parallel operation inside would wake a thread of the pool and wait for it: an eighth of a step of splats on two
/// cores (docs/research/performance.md).
///
/// Each thread has its own stream by default, and CubeCL waits across streams only for a tensor's creation, not for writes in place,
/// as those of Adam: steps on several threads would lose updates.
pub(crate) fn in_pool<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    if rayon::current_thread_index().is_some() {
        return work();
    }
    let (subscriber, span) = (dispatcher::get_default(Dispatch::clone), Span::current());
    let stream = StreamId::current();
    let work = || stream.executes(|| span.in_scope(work));
    rayon::scope(|_| dispatcher::with_default(&subscriber, work))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::thread;

    #[test]
    fn work_is_done_on_a_thread_of_the_pool_within_the_callers_span_and_stream() {
        let subscriber = tracing_subscriber::registry();
        dispatcher::with_default(&Dispatch::new(subscriber), || {
            let span = tracing::info_span!("outside");
            let stream = StreamId::current();
            let outside = span.in_scope(|| {
                in_pool(|| {
                    assert_eq!(StreamId::current(), stream);
                    let thread = thread::current().id();
                    // Already there: it stays on the thread.
                    assert_eq!(in_pool(|| thread::current().id()), thread);
                    assert!(rayon::current_thread_index().is_some());
                    Span::current().id()
                })
            });
            assert_eq!(outside, span.id());
            assert!(outside.is_some());
        });
    }
}
