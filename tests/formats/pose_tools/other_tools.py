"""Files of ROMP, BEV, SAM 3D Body and EasyMocap."""

import numpy as np

import body as b
import truth as t
from smpl_tools import F32, expect, verts

# MHR's joints that have a place in SMPL: the number there, and SMPL's.
MHR = {1: 0, 2: 1, 3: 4, 4: 7, 8: 10, 18: 2, 19: 5, 20: 8, 24: 11, 34: 0, 35: 3, 36: 6, 37: 9, 38: 14, 39: 17, 40: 19, 42: 21,
       74: 13, 75: 16, 76: 18, 78: 20, 110: 12, 113: 15}
# Sapiens' key points but for the fingers.
SAPIENS = {name: at for at, name in enumerate([
    "nose", "left_eye", "right_eye", "left_ear", "right_ear", "left_shoulder", "right_shoulder", "left_elbow", "right_elbow",
    "left_hip", "right_hip", "left_knee", "right_knee", "left_ankle", "right_ankle", "left_big_toe", "left_small_toe",
    "left_heel", "right_big_toe", "right_small_toe", "right_heel"])} | {"right_wrist": 41, "left_wrist": 62, "neck": 69}


def weak(posed, pixels):
    """s, tx, ty of the orthographic camera of a square image from -1 to 1 that fits best."""
    side = max(t.WIDTH, t.HEIGHT)
    square = (pixels + [(side - t.WIDTH) // 2, (side - t.HEIGHT) // 2]) / side * 2 - 1
    rows = np.zeros((2 * len(posed), 3))
    rows[0::2, 0], rows[1::2, 0] = posed[:, 0], posed[:, 1]
    rows[0::2, 1], rows[1::2, 2] = 1, 1
    return np.linalg.lstsq(rows, square.reshape(-1), rcond=None)[0]


def romp_frame(frame, bev=False, smpl=True, tracks=True):
    """The results of a frame, and the joints that they mean, by track."""
    side = max(t.WIDTH, t.HEIGHT)
    people = [(7, t.FIRST)] + ([(9, t.SECOND)] if frame in t.SEEN else [])
    k = t.pinhole((443.4 / 512 if smpl else 1.0) * side)
    out = {name: [] for name in ("cam", "smpl_thetas", "smpl_betas", "center_confs", "cam_trans")}
    full = {name: [] for name in ("verts", "joints", "pj2d_org")}
    seen = {}
    for track, person in people:
        s, tx, ty = cam = weak(person.posed[frame], person.pixels[frame])
        # With SMPL, a fit through the camera. Without, 2 [tx, ty, 1] / s, which doubles x and y: the
        # orthographic camera means [tx, ty, 2] / s.
        meant = t.placed(person.posed[frame], person.pixels[frame], k) if smpl else np.array([tx, ty, 2]) / s
        written = meant if smpl else 2 * np.array([tx, ty, 1]) / s
        joints = np.vstack([person.posed[frame], np.repeat(person.posed[frame][:1], 47, 0)])
        flat = (joints[:, :2] * s + [tx, ty] + 1) * side / 2
        out["cam"].append(cam[[0, 2, 1]] if bev else cam)
        out["smpl_thetas"].append(person.poses[frame])
        out["smpl_betas"].append(np.zeros(11 if bev else 10))
        out["center_confs"].append([0.9])
        out["cam_trans"].append(written)
        full["verts"].append(verts(person, frame))
        full["joints"].append(joints)
        full["pj2d_org"].append(flat - [(side - t.WIDTH) // 2, (side - t.HEIGHT) // 2])
        seen[track] = (person, person.posed[frame] + meant)
    out = {name: np.array(values, F32) for name, values in (out | (full if smpl else {})).items()}
    if tracks:
        out["track_ids"] = np.array([track for track, _ in people], np.int32)
    return out, seen, k


def romp(folder):
    """video_results.npz of ROMP with tracks; a file a frame of ROMP without its model and of BEV."""
    expected = {}
    for name, options in (("romp", {}), ("romp_without_smpl", {"smpl": False, "tracks": False}),
                          ("bev", {"bev": True, "tracks": False})):
        (folder / name).mkdir(parents=True)
        results, sequences, rows = {}, {}, {}
        for frame in range(t.FRAMES):
            out, seen, k = romp_frame(frame, **options)
            for track, (person, joints) in seen.items():
                rows.setdefault(track, (track, person, [], []))
                rows[track][2].append(frame)
                rows[track][3].append(joints)
            if name != "romp":
                np.savez(folder / f"{name}/{frame:08d}.npz", results=out)
                continue
            results[f"{frame:08d}.png"] = out
            for at, track in enumerate(out["track_ids"]):
                sequence = sequences.setdefault(track, {"frame_id": []})
                sequence["frame_id"].append(frame)
                for key, values in out.items():
                    sequence.setdefault(key, []).append(values[at])
        if results:
            np.savez(folder / "romp/video_results.npz", results=results, sequence_results=sequences)
        expected |= expect(name, k, list(rows.values()))
    return expected


def sam_3d_body(folder):
    """A file a frame and person, the fields of process_one_image; nothing tells who is who."""
    (folder / "sam_3d_body").mkdir(parents=True)
    rows = {1: (0, t.FIRST, [], []), 2: (1, t.SECOND, [], [])}
    for frame in range(t.FRAMES):
        people = [t.FIRST] + ([t.SECOND] if frame in t.SEEN else [])
        # The larger box comes first at even frames only.
        for at, person in enumerate(people if frame % 2 == 0 else people[::-1]):
            points, shift = person.points(frame), person.t[frame]
            keys = np.repeat(person.posed[frame][:1], 70, 0)
            for name, place in SAPIENS.items():
                keys[place] = points[name] - shift
            side = {"left": range(42, 62), "right": range(21, 41)}
            for name, fingers in side.items():
                keys[list(fingers)] = points[f"{name}_hand"] - shift
            coords, turns = np.repeat(person.posed[frame][:1], 127, 0), np.tile(np.eye(3), (127, 1, 1))
            for place, joint in MHR.items():
                coords[place] = person.posed[frame][joint]
                # The model's own axes have y up and z towards the camera.
                turns[place] = np.diag([1, -1, -1]) @ person.rotations[frame][joint]
            x0, y0, x1, y1 = person.box(frame)
            np.savez_compressed(
                folder / f"sam_3d_body/frame_{frame:04d}_subj{at:02d}.npz",
                bbox=np.array([x0, y0, x1, y1], F32), focal_length=F32(t.FOCAL), pred_keypoints_3d=keys.astype(F32),
                pred_keypoints_2d=t.project(keys + shift).astype(F32), pred_vertices=verts(person, frame),
                pred_cam_t=shift.astype(F32), pred_pose_raw=np.zeros(266, F32),
                global_rot=np.zeros(3, F32), body_pose_params=np.zeros(133, F32), hand_pose_params=np.zeros(108, F32),
                scale_params=np.zeros(28, F32), shape_params=np.zeros(45, F32), expr_params=np.zeros(72, F32),
                mask=person.mask(frame)[..., None].astype(np.uint8), pred_joint_coords=coords.astype(F32),
                pred_global_rots=turns.astype(F32), mhr_model_params=np.zeros(204, F32))
            rows[person.number][2].append(frame)
            rows[person.number][3].append(person.joints[frame])
    return expect("sam_3d_body", t.K, list(rows.values()))


def matrix(key, value):
    data = ", ".join(f"{v:.6f}" for v in np.asarray(value).reshape(-1))
    rows, columns = np.asarray(value).shape
    return [f"{key}: !!opencv-matrix", f"  rows: {rows}", f"  cols: {columns}", "  dt: d", f"  data: [{data}]"]


def table(value):
    """As EasyMocap's myarray2string: three digits."""
    lines = ["["]
    for at, row in enumerate(value):
        comma = ", " if at + 1 < len(value) else ""
        lines.append("          [{}]{}".format(", ".join(f"{v:.3f}" for v in row), comma))
    return "\r\n".join([*lines, "        ]"])


def easymocap(folder):
    """smpl/*.json with Rh and Th in a world with z up, and the camera of intri.yml and extri.yml."""
    person = t.FIRST
    # World to camera: the camera stands 1.1 m high and looks along y.
    r = b.rodrigues([0, 0.1, 0]) @ np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    shift = r @ np.array([0.0, 0.0, -1.1])
    root = folder / "easymocap"
    (root / "output/smpl").mkdir(parents=True)
    joints = []
    for frame in range(t.FRAMES):
        # World from camera, of the root's rotation and of Th = t + J0 − R·J0.
        turn = b.rodrigues(person.poses[frame][:3])
        th = person.t[frame] + t.PELVIS - turn @ t.PELVIS
        rh, th = np.round(t.vector(r.T @ turn), 3), np.round(r.T @ (th - shift), 3)
        pose = np.round(person.poses[frame], 3)
        pose[:3] = 0
        text = ",\r\n".join(f'        "{name}": {table(value)}' for name, value in (
            ("Rh", rh[None]), ("Th", th[None]), ("poses", pose[None]), ("shapes", np.zeros((1, 10)))))
        text = f'{{\r\n    "annots": [\r\n    {{\r\n        "id": 0,\r\n{text}\r\n    }}\r\n]}}\r\n'
        (root / f"output/smpl/{frame:06d}.json").write_text(text, newline="")
        inner, _ = t.forward(pose)
        joints.append((inner @ b.rodrigues(rh).T + th) @ r.T + shift)
    head = ["%YAML:1.0", "---", "names:", '  - "01"']
    intri = head + matrix("K_01", t.K) + matrix("dist_01", np.zeros((1, 5))) + [f"H_01: {t.HEIGHT}", f"W_01: {t.WIDTH}"]
    extri = head + matrix("R_01", t.vector(r)[:, None]) + matrix("Rot_01", r) + matrix("T_01", shift[:, None])
    for name, lines in (("intri", intri), ("extri", extri)):
        (root / f"{name}.yml").write_text("\r\n".join(lines) + "\r\n", newline="")
    return expect("easymocap", t.K, [(0, person, range(t.FRAMES), joints)])
