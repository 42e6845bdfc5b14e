//! The rules of the queue, as pure functions of numbers. The store applies them in its transactions; they are
//! the same for every database.
//!
//! | rule | where |
//! |---|---|
//! | the order of the queue: priority, then the owner with the fewest running jobs, then age | `scripts/queue.rs`, since only the database can search |
//! | a job that keeps losing workers ends | [`losses`] |
//! | a job whose resources fail waits longer each time | [`retries`] |
//! | how a render is divided among workers | [`ranges`] |
//! | a deletion applies only to the version that its caller has seen | [`etag`] |
//! | an outage of the coordinator charges nobody | [`outage`] |
//! | steps of the clock do not count for ages | [`steps`] |
//! | the checkpoint that renders use | [`best`] |
//! | the checkpoints that are kept | [`retention`] |
//! | the figures that are kept for a training's curve | [`thinning`] |

pub mod best;
pub mod etag;
pub mod losses;
pub mod outage;
pub mod ranges;
pub mod retention;
pub mod retries;
pub mod rights;
pub mod steps;
pub mod thinning;
