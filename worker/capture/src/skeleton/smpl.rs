//! The joint tree of SMPL, as the contract has it.

pub use yoto_proto::smpl::JOINTS;
