//! The gRPC services, a file each. They parse names and fields, call the room below, and
//! turn its answer into messages; rules stand in `jobs`, `objects` and `store`.

mod fields;
mod jobs;
mod models;
mod paging;
mod renders;
mod status;
mod subjects;
mod workers;

pub use jobs::JobApi;
pub use models::ModelApi;
pub use renders::RenderApi;
pub use subjects::SubjectApi;
pub use workers::WorkerApi;
