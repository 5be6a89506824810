-- Dims @VIDEO@ (@VERSION@, gamma @GAMMA@) in mpv while it plays: mpv --script=FILE VIDEO
-- Needs mpv 0.35 or later, with --vo=gpu or gpu-next; SDR. A shader multiplies R'G'B' by factor^(1/gamma), and
-- takes the scale from a texture of one pixel, so that nothing is compiled again when it changes.

local DURATION, FRAME = @DURATION@, @FRAME@ -- [s] of the video, and of one of its frames
local START = @START@ -- [s]: the first stamp of the file; most files are played as if it were 0
local STREAM = @STREAM@ -- of the file, as FFmpeg counts them; nil if it has one video only
local TRACK = [[
@TRACK@
]] -- on each line, from which time on [s] which scale holds

local SHADER = [[
//!TEXTURE EVENLIGHT_SCALE
//!SIZE 1 1
//!FORMAT rgba8
//!FILTER NEAREST
%02x%02x00ff

//!HOOK MAIN
//!BIND HOOKED
//!BIND EVENLIGHT_SCALE
//!DESC Evenlight: dim by a track
vec4 hook() {
    vec4 bytes = texture(EVENLIGHT_SCALE, vec2(0.5));
    vec4 colour = HOOKED_texOff(vec2(0.0));
    float scale = (bytes.r * 65280.0 + bytes.g * 255.0) / 65535.0;
    colour.rgb = clamp(colour.rgb, 0.0, 1.0) * scale; // brighter than white is white before it is dimmed
    return colour;
}
]]

local times, scales, written = {}, {}, {}
local current, shown -- the shader file in use, nil while nothing is dimmed, and what scale it has
local dimming, said -- whether this video is dimmed; if not, why

for time, scale in TRACK:gmatch("(%S+) (%S+)") do
    times[#times + 1], scales[#scales + 1] = tonumber(time), tonumber(scale)
end

local function scale_at(time)
    local low, high = 1, #times -- the last one that begins no later; before the first, the first
    while low < high do
        local middle = math.ceil((low + high) / 2)
        if times[middle] <= time then low = middle else high = middle - 1 end
    end
    return scales[low]
end

local function use(shader) -- in one step, so that no frame goes without or has two
    local list = {}
    for _, path in ipairs(mp.get_property_native("glsl-shaders")) do
        if path ~= current then list[#list + 1] = path end
    end
    list[#list + 1] = shader
    mp.set_property_native("glsl-shaders", list)
    current = shader
end

local function written_shader(code)
    local path = os.tmpname() -- which makes the file: nobody else can have put one there
    local file = assert(io.open(path, "w"))
    file:write(SHADER:format(math.floor(code / 256), code % 256))
    file:close()
    written[#written + 1] = path
    if #written > 16 then os.remove(table.remove(written, 1)) end -- mpv has read it long ago
    return path
end

local function refusal() -- what is not known yet when a file is loaded is asked again when it plays
    local duration, gamma = mp.get_property_number("duration"), mp.get_property("video-params/gamma")
    local vo = mp.get_property("current-vo") or "gpu"
    if not duration or math.min(math.abs(duration - DURATION), math.abs(duration - DURATION - START)) > 0.5 then
        return ("this video takes %.1f s, the track %.1f s"):format(duration or 0, DURATION)
    elseif gamma == "pq" or gamma == "hlg" then
        return "this video is HDR, the track is for SDR"
    elseif vo ~= "gpu" and vo ~= "gpu-next" and vo ~= "libmpv" then
        return "dimming needs --vo=gpu or --vo=gpu-next, not " .. vo
    end
end

local function played_from() -- the stamp whose position is 0: not in all formats the first one
    return mp.get_property_bool("rebase-start-time") and mp.get_property_number("demuxer-start-time") or 0
end

local function follow(_, time)
    if time and dimming then
        local code = math.floor(scale_at(time + played_from() - START + FRAME / 4) * 65535 + 0.5)
        if code ~= shown or not current then use(written_shader(code)) end
        shown = code
    end
end

local function stop()
    dimming = false
    if current then use(nil) end
end

local function choose() -- before any packet is read: later, a transport stream would lose its first second
    for _, track in ipairs(mp.get_property_native("track-list")) do
        if STREAM and track.type == "video" and track["ff-index"] == STREAM then
            mp.set_property("file-local-options/vid", track.id)
        end
    end
end

local function begin()
    local reason = refusal()
    dimming = not reason
    if dimming then
        follow(nil, mp.get_property_number("time-pos") or 0)
    else
        stop()
        if reason ~= said then
            mp.msg.error("not dimmed: " .. reason)
            mp.osd_message("Not dimmed: " .. reason, 10)
        end
    end
    said = reason
end

mp.add_hook("on_preloaded", 50, choose)
mp.register_event("file-loaded", begin)
mp.register_event("playback-restart", begin)
mp.register_event("end-file", stop)
mp.observe_property("time-pos", "number", follow) -- while it plays, after a seek, and at each step of a pause
mp.register_event("shutdown", function()
    for _, path in ipairs(written) do os.remove(path) end
end)
