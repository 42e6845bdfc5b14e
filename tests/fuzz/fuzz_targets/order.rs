//! An order of a job: faults that say what is wrong, or an order that stays good when it is written again.
#![no_main]

use libfuzzer_sys::fuzz_target;
use prost::Message;
use yoto_proto::v1::JobSpec;
use yoto_proto::v1::job_spec::Kind;
use yoto_proto::{checks, exports, orders, render_needs};

fuzz_target!(|bytes: &[u8]| {
    let Ok(spec) = JobSpec::decode(bytes) else {
        return;
    };
    assert!(orders::level(&spec) <= orders::LEVEL);
    let faults = checks::job(&spec);
    assert!(faults.iter().all(|fault| !fault.message.is_empty()));
    if !faults.is_empty() {
        return;
    }
    let again = JobSpec::decode(spec.encode_to_vec().as_slice()).expect("its own bytes");
    assert_eq!(checks::job(&again), []);
    assert_eq!(orders::level(&again), orders::level(&spec));
    // What the service and a worker do with a good order.
    match &spec.kind {
        Some(Kind::Render(render)) => {
            let models = render_needs::other_models(render);
            for need in render_needs::needs(render) {
                assert!(need.model == render.model || models.iter().any(|it| it.1 == need.model));
            }
        }
        Some(Kind::Export(export)) => assert!(!exports::needs(export).is_empty()),
        _ => (),
    }
});
