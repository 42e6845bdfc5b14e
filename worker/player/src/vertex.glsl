#version 300 es
precision highp float;
precision highp int;
precision highp sampler2D;
precision highp usampler2D;
uniform sampler2D splats;
uniform usampler2D bones;
uniform sampler2D shares;
uniform sampler2D matrices;
uniform sampler2D shine;
uniform sampler2D places;
uniform int harmonics;
uniform float most;
uniform vec4 camera[3];
uniform vec4 lens;
uniform vec2 size;
uniform float light[24];
uniform float tint;
in uint splat;
flat out vec3 conic;
flat out vec4 paint;
out vec2 offset;

void main() {
  ivec2 at = ivec2(int(splat) % 256, int(splat) / 256);
  vec4 place = texelFetch(splats, ivec2(4 * at.x, at.y), 0);
  vec4 turn = normalize(texelFetch(splats, ivec2(4 * at.x + 1, at.y), 0));
  vec3 deviations = texelFetch(splats, ivec2(4 * at.x + 2, at.y), 0).xyz;
  vec4 look = texelFetch(splats, ivec2(4 * at.x + 3, at.y), 0);
  vec3 colour = look.xyz;
  uvec4 bone = texelFetch(bones, at, 0);
  vec4 share = texelFetch(shares, at, 0);
  vec4 carry[3];
  for (int r = 0; r < 3; r++) {
    carry[r] = vec4(0.0);
    for (int b = 0; b < 4; b++) carry[r] += share[b] * texelFetch(matrices, ivec2(r, int(bone[b])), 0);
  }
  float sum = share.x + share.y + share.z + share.w;
  vec4 point = vec4(texelFetch(places, at, 0).xyz, 1.0);
  vec4 world = vec4(vec3(dot(carry[0], point), dot(carry[1], point), dot(carry[2], point)) / sum, 1.0);
  vec3 seen = vec3(dot(camera[0], world), dot(camera[1], world), dot(camera[2], world));
  float opacity = place.w;
  gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  if (seen.z < 0.05 || opacity <= 1.0 / 255.0) return;

  float w = turn.x, x = turn.y, y = turn.z, z = turn.w;
  // Columns.
  mat3 rotation = mat3(
    1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y),
    2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x),
    2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y));
  mat3 linear = transpose(mat3(carry[0].xyz, carry[1].xyz, carry[2].xyz)) / sum;
  mat3 axes = linear * rotation;
  mat3 view = transpose(mat3(camera[0].xyz, camera[1].xyz, camera[2].xyz));
  if (harmonics > 0) {
    // From the camera to the splat, as the rest pose has it.
    vec3 v = transpose(linear) * (transpose(view) * seen);
    v /= max(length(v), 1e-9);
    float basis[8] = float[8](
      -0.4886025 * v.y, 0.4886025 * v.z, -0.4886025 * v.x,
      1.0925484 * v.x * v.y, -1.0925484 * v.y * v.z, 0.31539157 * (2.0 * v.z * v.z - v.x * v.x - v.y * v.y),
      -1.0925484 * v.x * v.z, 0.5462742 * (v.x * v.x - v.y * v.y));
    for (int k = 0; k < 8; k++) {
      if (k < harmonics) {
        vec3 own = texelFetch(shine, ivec2(harmonics * at.x + k, at.y), 0).rgb;
        colour += basis[k] * most * (255.0 * own - 128.0) / 127.0;
      }
    }
  }
  vec3 n = axes[2] / max(length(axes[2]), 1e-6);
  float terms[8] = float[8](n.x, n.y, n.z, n.x * n.y, n.y * n.z, n.z * n.x, n.x * n.x - n.y * n.y, 3.0 * n.z * n.z - 1.0);
  for (int c = 0; c < 3; c++) {
    float shade = 1.0;
    for (int t = 0; t < 8; t++) shade += light[8 * c + t] * terms[t];
    colour[c] *= shade;
  }
  // What is guessed, in a colour that no skin and hardly any cloth has.
  colour = mix(colour, vec3(0.85, 0.1, 0.85), 0.6 * tint * look.w);
  mat3 spread = view * axes * mat3(deviations.x, 0.0, 0.0, 0.0, deviations.y, 0.0, 0.0, 0.0, deviations.z);
  vec3 across = vec3(lens.x / seen.z, 0.0, -lens.x * seen.x / (seen.z * seen.z)) * spread;
  vec3 down = vec3(0.0, lens.y / seen.z, -lens.y * seen.y / (seen.z * seen.z)) * spread;
  float xx = dot(across, across) + 0.1, xy = dot(across, down), yy = dot(down, down) + 0.1;
  float determinant = max(xx * yy - xy * xy, 1e-8);
  conic = vec3(yy, -xy, xx) / determinant;
  paint = vec4(colour, opacity);
  vec2 reach = sqrt(2.0 * log(255.0 * opacity) * vec2(xx, yy));
  offset = reach * (vec2(gl_VertexID & 1, (gl_VertexID >> 1) & 1) * 2.0 - 1.0);
  vec2 pixel = lens.xy * seen.xy / seen.z + lens.zw + offset;
  gl_Position = vec4(2.0 * pixel.x / size.x - 1.0, 1.0 - 2.0 * pixel.y / size.y, 0.0, 1.0);
}
