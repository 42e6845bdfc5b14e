//! Counts the statements that a task sends to the database, so that a page tells what it costs.

use std::cell::Cell;
use std::future::Future;

tokio::task_local! {
    static COUNT: Cell<u32>;
}

/// Does `work`, and counts the statements that it sends.
pub async fn counted<F: Future>(work: F) -> (F::Output, u32) {
    let count_after = async {
        let output = work.await;
        (output, COUNT.with(Cell::get))
    };
    COUNT.scope(Cell::new(0), count_after).await
}

/// A statement is sent. Costs nothing where nobody counts.
pub fn sent() {
    let _ = COUNT.try_with(|count| count.set(count.get() + 1));
}
