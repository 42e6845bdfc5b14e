"""Writes captures/: see ../README.md."""

import json
import shutil
from pathlib import Path

import key_points
import other_tools
import smpl_tools
import truth

OUT = Path(__file__).resolve().parent / "captures"


def main():
    shutil.rmtree(OUT, ignore_errors=True)
    OUT.mkdir()
    truth.pictures(OUT / "clip", [truth.FIRST, truth.SECOND])
    expected = {}
    for write in (smpl_tools.phalp, smpl_tools.wham, smpl_tools.gvhmr, smpl_tools.tram, smpl_tools.prompt_hmr,
                  smpl_tools.lhm, smpl_tools.ex_avatar, other_tools.romp, other_tools.sam_3d_body, other_tools.easymocap):
        expected |= write(OUT)
    for write in (key_points.openpose, key_points.alphapose, key_points.mmpose, key_points.mediapipe):
        write(OUT)
    people = [{"poses": p.poses.tolist(), "t": p.t.tolist(), "joints": p.joints.tolist(), "pixels": p.pixels.tolist()}
              for p in (truth.FIRST, truth.SECOND)]
    out = {"image_size": [truth.WIDTH, truth.HEIGHT], "k": truth.K.tolist(), "rest_joints": truth.REST.tolist(),
           "second_seen": list(truth.SEEN), "people": people, "tools": expected}
    rounded = json.loads(json.dumps(out), parse_float=lambda text: round(float(text), 4))
    (OUT / "expected.json").write_text(json.dumps(rounded, separators=(",", ":")))


if __name__ == "__main__":
    main()
