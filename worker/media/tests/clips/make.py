"""Makes the clips of the video tests: 20 frames of 50x38 pixels at 15 a second.

Frame i is one colour, (20 + 10 i, 100, 210 - 10 i), with a white bar of 6 columns from column
2 i, so that order, colour and turn can be told. Needs an ffmpeg with x264 and x265:

    python3 make.py path/to/ffmpeg
"""

import subprocess
import sys

WIDTH, HEIGHT, FRAMES = 50, 38, 20


def frame(i):
    row = b"".join(
        bytes([255, 255, 255] if 2 * i <= x < 2 * i + 6 else [20 + 10 * i, 100, 210 - 10 * i])
        for x in range(WIDTH)
    )
    return row * HEIGHT


RAW = b"".join(frame(i) for i in range(FRAMES))


def make(name, *options, source=()):
    command = [sys.argv[1], "-y", "-v", "error", "-f", "rawvideo", "-pix_fmt", "rgb24"]
    command += ["-s", f"{WIDTH}x{HEIGHT}", "-r", "15", "-i", "pipe:0", *options, "-bitexact", name]
    subprocess.run(command, input=RAW, check=True)


X264 = ["-c:v", "libx264", "-crf", "8", "-pix_fmt", "yuv420p"]
B_FRAMES = ["-x264-params", "bframes=3:b-adapt=0:b-pyramid=normal:keyint=12"]
make("b_frames.mp4", *X264, *B_FRAMES)
make("b_frames.mov", *X264, *B_FRAMES)
make("baseline.mp4", *X264, "-profile:v", "baseline")
make("fragmented.mp4", *X264, *B_FRAMES, "-movflags", "frag_keyframe+empty_moov+default_base_moof")
# Five frames at 15 a second, then a pause of three frames, and so on.
PAUSES = ["-vf", "setpts=(N+floor(N/5)*3)/15/TB", "-fps_mode", "passthrough"]
make("pauses.mp4", *X264, *B_FRAMES, *PAUSES)
make("yuv422.mp4", "-c:v", "libx264", "-crf", "8", "-pix_fmt", "yuv422p")
make("hevc.mp4", "-c:v", "libx265", "-crf", "8", "-pix_fmt", "yuv420p", "-tag:v", "hvc1", "-x265-params", "log-level=error")
make("mjpeg.avi", "-c:v", "mjpeg", "-q:v", "2")
turn = [sys.argv[1], "-y", "-v", "error", "-display_rotation", "-90", "-i", "b_frames.mp4"]
subprocess.run([*turn, "-c", "copy", "-bitexact", "turned_right.mp4"], check=True)
