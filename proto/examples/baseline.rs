//! Writes the descriptors of the current contract to `baseline/v1.binpb`, against which a test holds later
//! ones. Comments are left out.

use prost::Message;
use prost_types::FileDescriptorSet;
use std::error::Error;
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    let mut set = FileDescriptorSet::decode(yoto_proto::DESCRIPTORS)?;
    for file in &mut set.file {
        file.source_code_info = None;
    }
    let place = Path::new(env!("CARGO_MANIFEST_DIR")).join("baseline/v1.binpb");
    std::fs::create_dir_all(place.parent().ok_or("no folder")?)?;
    std::fs::write(place, set.encode_to_vec())?;
    Ok(())
}
